"""A declared model on recorded axes: fit, trace, close."""
