"""Models of a joint."""
