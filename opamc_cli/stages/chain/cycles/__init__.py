"""The segments of an axis, and the cycle that they are identified by."""
