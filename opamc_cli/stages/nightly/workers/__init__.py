"""Nights judged by processes of their own, here or in a cluster."""
