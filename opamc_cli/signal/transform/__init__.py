"""Transforms of a stream: analytic signal, wavelets, short-time spectra."""
