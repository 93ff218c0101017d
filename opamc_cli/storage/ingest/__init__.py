"""Foreign formats turned into runs."""
