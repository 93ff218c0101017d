"""Whether two sides of a diagnosis may be compared at all, asked before anything is judged."""
