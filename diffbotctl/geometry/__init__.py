"""Plane geometry shared by blocks and plant."""
