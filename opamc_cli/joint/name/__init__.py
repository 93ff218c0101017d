"""Name what the residual holds: a beam of chains, scored by what they predict of held-out data."""
