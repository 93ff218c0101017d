"""The model of a joint's motor current, and the loop that finds what it lacks."""
