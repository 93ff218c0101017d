"""Explain what is left without a name: smooth functions of every covariate, lines, responses."""
