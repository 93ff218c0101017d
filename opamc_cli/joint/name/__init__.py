"""Name what the residual holds: a beam of chains, each scored by what it predicts of held-out data."""
