"""A first map for an unknown recording, every line with what speaks for it."""
