"""The run format: one recording = one Parquet file, one row per sample."""
