"""Parameters of the ordinal patterns."""
