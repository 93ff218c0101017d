"""Cycles of a program, and which motion of it a segment is."""
