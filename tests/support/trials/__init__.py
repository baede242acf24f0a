"""Measurements of the finished program, each a table of figures beside their targets."""
