"""When a joint moves, and in which sense."""
