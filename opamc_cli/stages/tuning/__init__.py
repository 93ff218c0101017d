"""Delay and order of the patterns: sweep and select."""
