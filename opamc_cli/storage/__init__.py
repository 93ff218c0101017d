"""Files: the run format, stage tables, foreign formats."""
