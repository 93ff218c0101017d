"""Ordinal patterns."""
