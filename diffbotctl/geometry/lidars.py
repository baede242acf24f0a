"""Lidars that a robot file can name, with the figures of their data sheets.

The rows are in parts/lidars.yaml.
"""

from __future__ import annotations

from math import pi
from typing import Literal, NamedTuple

from diffbotctl import parts
from diffbotctl.time import SECOND

LidarProtocol = Literal["lds01", "lds02", "ldrobot", "rplidar", "ydlidar"]
MotorControl = Literal["internal", "dtr_low", "dtr_high"]


class LidarModel(NamedTuple):
    """Figures of a lidar, and how to speak to it."""

    title: str
    protocol: LidarProtocol
    baud: int
    near: float  # m; closer objects are detected but not measured
    reach: float  # m
    rays: int  # of one scan, clockwise from the lidar's zero angle
    rate: float  # turns a second, typical
    samples: int  # a second
    size: tuple[float, float, float]  # m: depth, width, height
    mass: float  # kg
    start: str = ""  # hexadecimal, as all requests; empty: it sends as soon as it has power
    stop: str = ""
    health: str = ""
    reset: str = ""
    motor: MotorControl = "internal"
    """the level of DTR at which the motor turns, if an adapter switches it by that line"""

    @property
    def ray_angle(self) -> float:
        """Angle between two neighbouring rays, rad."""
        return 2 * pi / self.rays

    @property
    def period(self) -> int:
        """Time of a turn, ns."""
        return round(SECOND / self.rate)


LIDARS = {name: LidarModel(**row) for name, row in parts.rows("lidars").items()}
