"""Divergences of ordinal patterns, and what is made of them."""
