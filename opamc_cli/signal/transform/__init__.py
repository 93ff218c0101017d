"""Transforms of a stream: analytic signal, wavelets, short-time and order spectra."""
