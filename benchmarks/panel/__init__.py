"""Sources, contestants and tables of benchmarks/panel.py."""
