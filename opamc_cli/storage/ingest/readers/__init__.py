"""One file for each foreign format: how its channels are named and read."""
