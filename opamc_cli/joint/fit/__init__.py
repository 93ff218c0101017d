"""Least squares of a declared model, with units left out in turn."""
