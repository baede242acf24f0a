"""A robot control stack for low-cost differential-drive robots."""

__version__ = "0.2.0"
