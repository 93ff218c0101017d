"""The history of a cell: one SQLite file, every night that was judged, and what was said of it."""
