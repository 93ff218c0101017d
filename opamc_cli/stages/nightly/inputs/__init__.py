"""What there is of a cell: its recordings, and which of them may be judged."""
