"""What changed between two sets of recordings of one joint."""
