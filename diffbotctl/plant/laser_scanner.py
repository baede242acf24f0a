"""A laser scanner: once a turn it tells the distance along each of its rays."""

from __future__ import annotations

from math import inf, pi
from random import Random
from typing import NamedTuple

from diffbotctl.plant.world import World


class ScannerModel(NamedTuple):
    """What the data sheet of a scanner says."""

    rays: int  # a turn, the first one straight ahead, counter-clockwise
    nearest: float  # m; closer things are seen but not measured
    reach: float  # m
    period: int  # ns a turn


# HLS-LFCD LDS-01: 360 rays five times a second, 0.12 to 3.5 m.
PARTS = {"lds01": ScannerModel(360, 0.12, 3.5, 200_000_000)}


class Scanner:
    """One simulated scanner. All rays of a turn are taken at its end, at one moment.

    A real one's first ray is a fifth of a second older than its last; at 0.22 m/s that is 44 mm, at
    which a driver that knows the robot's motion puts them right.
    """

    def __init__(self, part: ScannerModel, spread: float, chance: Random) -> None:
        """`spread`: standard deviation of a distance, m."""
        self.part, self._spread, self._chance = part, spread, chance
        self.due = part.period
        self.step = 2 * pi / part.rays

    def measure(self, world: World, x: float, y: float, heading: float) -> tuple[float, ...]:
        """Distances (m) seen from (x, y) in the world: inf when clear, 0 when too close."""
        self.due += self.part.period
        nearest, reach, spread, gauss = (
            self.part.nearest,
            self.part.reach,
            self._spread,
            self._chance.gauss,
        )
        told = []
        for distance in world.scan(x, y, heading, self.part.rays):
            if distance > reach:
                told.append(inf)
            elif distance < nearest:
                told.append(0.0)
            else:
                told.append(max(distance + gauss(0.0, spread), nearest) if spread else distance)
        return tuple(told)
