"""What a verdict and a loop say, in words."""
