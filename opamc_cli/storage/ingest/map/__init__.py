"""The map file: which channel becomes which column, in which unit."""
