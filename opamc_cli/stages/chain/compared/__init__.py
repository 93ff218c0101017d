"""Baseline and target: sessions, rows that can be compared, trained discriminants."""
