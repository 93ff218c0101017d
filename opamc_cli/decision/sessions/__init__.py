"""Sessions judged by themselves: each of the target, and those of a baseline that are odd."""
