"""What others read in the morning: page and metrics."""
