"""Flashing a program onto a board, as a stream of events."""
