"""Verdicts: from runs, from tables, and as a report."""
