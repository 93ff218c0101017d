"""The virtual robot: a six-axis arm with strain wave gears."""
