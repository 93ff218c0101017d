"""A cell, night by night."""
