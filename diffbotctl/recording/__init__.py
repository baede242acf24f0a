"""Recordings and the black box: writing, reading, metrics."""
