"""The vocabulary: one effect per file."""
