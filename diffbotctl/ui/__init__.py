"""Screens and texts of runs, recordings and calibrations."""
