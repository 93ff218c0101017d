"""How surprising a distance is."""
