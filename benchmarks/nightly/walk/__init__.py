"""Cell, steps and checks of benchmarks/nightly/nightly_walk.py."""
