"""From ordinal counts to a decision: divergence, features, discriminant, p-values."""
