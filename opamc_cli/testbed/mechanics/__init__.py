"""The compiled inner loop and what it integrates."""
