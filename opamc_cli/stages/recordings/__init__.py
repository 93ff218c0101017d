"""Runs: how they come in, and their channels as the science wants them."""
