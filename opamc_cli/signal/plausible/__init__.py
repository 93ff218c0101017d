"""Signs that channels are of one joint, one clock and one unit, and whole; what sensors err by."""
