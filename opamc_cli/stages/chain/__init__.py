"""The chain of the method: segment, identify, patterns, score."""
