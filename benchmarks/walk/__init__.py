"""Cell, steps and checks of benchmarks/nightly_walk.py."""
