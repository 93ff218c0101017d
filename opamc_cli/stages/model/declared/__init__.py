"""What a user declares of a joint, made ready for the fit."""
