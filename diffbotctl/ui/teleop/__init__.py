"""Keyboard teleoperation from a terminal."""
