"""Walls and round obstacles around the simulated robot, and rays cast against them. Metres."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, inf, sin, sqrt
from typing import NamedTuple

PARALLEL = (
    1e-12  # m; a wall whose direction is this near the ray's is seen from its end: not at all
)


class Wall(NamedTuple):
    """A straight wall from (x1, y1) to (x2, y2)."""

    x1: float
    y1: float
    x2: float
    y2: float


class Round(NamedTuple):
    """A round obstacle."""

    x: float
    y: float
    radius: float


class World:
    """Everything that a distance sensor can see or a robot can hit."""

    def __init__(self, walls: Sequence[Wall] = (), rounds: Sequence[Round] = ()) -> None:
        self.walls = tuple(walls)
        self.rounds = tuple(rounds)

    @property
    def empty(self) -> bool:
        """True when there is nothing to see."""
        return not self.walls and not self.rounds

    def distance(self, x: float, y: float, bearing: float) -> float:
        """Distance (m) along `bearing` (rad) from (x, y) to the nearest thing; inf when clear."""
        ahead, aside = cos(bearing), sin(bearing)
        nearest = inf
        for wall in self.walls:
            nearest = min(nearest, to_wall(x, y, ahead, aside, wall))
        for thing in self.rounds:
            nearest = min(nearest, to_round(x, y, ahead, aside, thing))
        return nearest


def to_wall(x: float, y: float, ahead: float, aside: float, wall: Wall) -> float:
    """Distance from (x, y) along the unit vector (ahead, aside) to `wall`; inf when it misses."""
    along_x, along_y = wall.x2 - wall.x1, wall.y2 - wall.y1
    cross = ahead * along_y - aside * along_x
    if abs(cross) < PARALLEL:
        return inf
    from_x, from_y = wall.x1 - x, wall.y1 - y
    share = (from_x * aside - from_y * ahead) / cross
    far = (from_x * along_y - from_y * along_x) / cross
    return far if 0.0 <= share <= 1.0 and far >= 0.0 else inf


def to_round(x: float, y: float, ahead: float, aside: float, thing: Round) -> float:
    """Distance from (x, y) along the unit vector to `thing`; 0 inside it, inf when it misses."""
    from_x, from_y = thing.x - x, thing.y - y
    near = from_x * ahead + from_y * aside
    rest = from_x * from_x + from_y * from_y - thing.radius * thing.radius
    if rest <= 0.0:
        return 0.0
    square = near * near - rest
    return near - sqrt(square) if near > 0.0 and square >= 0.0 else inf
