"""The spread of values of which some may lie anywhere; loads nothing, as a look at a cell wants."""

MAD_TO_SIGMA = 1.4826
"""Standard deviation of a normal variable over its median absolute deviation."""
