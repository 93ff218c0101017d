"""The report's figures, one per file; each raises `NothingToDrawError` where it cannot be drawn."""
