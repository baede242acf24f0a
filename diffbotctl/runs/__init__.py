"""Whole runs: files in, a robot that was stopped out."""
