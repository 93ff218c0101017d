"""Dates, time stamps and uniform grids."""
