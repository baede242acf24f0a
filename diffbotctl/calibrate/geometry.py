"""The three lengths that a differential drive's dead reckoning rests on."""

from __future__ import annotations

from typing import NamedTuple


class Geometry(NamedTuple):
    """Wheel diameters and track, all in m (or all in one other unit of length)."""

    right: float
    """effective diameter of the right wheel"""
    left: float
    """effective diameter of the left wheel"""
    track: float
    """distance between the places where the two wheels touch the ground"""

    @property
    def mean(self) -> float:
        """Mean wheel diameter, which sets the scale of distances."""
        return (self.right + self.left) / 2

    @property
    def ratio(self) -> float:
        """Right diameter over left, Borenstein and Feng's E_d: above 1 the robot curves left."""
        return self.right / self.left

    def reshaped(self, ratio: float, track: float) -> Geometry:
        """The same mean diameter split in another `ratio`, with another `track`."""
        left = 2 * self.mean / (ratio + 1)
        return Geometry(ratio * left, left, track)
