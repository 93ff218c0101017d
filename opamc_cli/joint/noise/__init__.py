"""Spectra and colour of what is left."""
