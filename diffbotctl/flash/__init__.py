"""Bringing a program onto the board: the whole task, told as events that others draw."""
