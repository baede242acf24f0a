"""Laser scanners that a robot file can name, with the figures of their data sheets."""

from __future__ import annotations

from math import pi
from typing import NamedTuple


class ScannerModel(NamedTuple):
    """Data sheet figures of a laser scanner."""

    rays: int
    """per turn; the first one straight ahead, then counter-clockwise"""
    nearest: float
    """m; closer objects are detected but not measured"""
    reach: float
    """m"""
    period: int
    """ns per turn"""

    @property
    def ray_angle(self) -> float:
        """Angle between two neighbouring rays, rad."""
        return 2 * pi / self.rays


# HLS-LFCD LDS-01: 360 rays five times a second, 0.12 to 3.5 m.
LASER_SCANNERS = {"lds01": ScannerModel(360, 0.12, 3.5, 200_000_000)}
