"""Pairs of recordings, and the plain rival, of benchmarks/cause.py."""
