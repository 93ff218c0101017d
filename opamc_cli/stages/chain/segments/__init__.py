"""Segments of one axis, by what was recorded."""
