"""An output folder as the report reads it."""
