"""What is the measurement's and not the gear's: a noisy sensor, a late log."""
