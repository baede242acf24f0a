"""Walls and round obstacles around the simulated robot, and rays cast against them. Metres."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, ceil, cos, floor, hypot, inf, pi, sin, sqrt
from typing import NamedTuple

from diffbotctl.config.configuration import WorldEntry

PARALLEL = (
    1e-12  # m; a wall whose direction is this near the ray's is seen from its end: not at all
)


class Wall(NamedTuple):
    """A straight wall from (x1, y1) to (x2, y2)."""

    x1: float
    y1: float
    x2: float
    y2: float


class Pillar(NamedTuple):
    """A round obstacle."""

    x: float
    y: float
    radius: float


class World:
    """Everything that a distance sensor can see or a robot can hit."""

    def __init__(
        self,
        walls: Sequence[Wall] = (),
        rounds: Sequence[Pillar] = (),
        field: tuple[float, float] | None = None,
    ) -> None:
        """`field`: width and depth, from (0, 0), of a walled field that no robot can leave."""
        self.rounds = tuple(rounds)
        self.field = field
        self.walls = tuple(walls)
        if field is not None:
            right, top = field
            self.walls += (
                Wall(0.0, 0.0, right, 0.0),
                Wall(right, 0.0, right, top),
                Wall(right, top, 0.0, top),
                Wall(0.0, top, 0.0, 0.0),
            )

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

    def scan(self, x: float, y: float, heading: float, rays: int) -> list[float]:
        """Distances (m) from (x, y) along `rays` even bearings from `heading` (rad) on, once round.

        As `distance` along each, but every thing is looked at only by the rays that can meet it.
        """
        found = [inf] * rays
        for wall in self.walls:
            _scan_wall(found, x, y, heading, wall)
        for thing in self.rounds:
            _scan_round(found, x, y, heading, thing)
        return found

    def kept(self, x: float, y: float) -> tuple[float, float]:
        """(x, y), or the nearest place to it inside the field."""
        if self.field is None:
            return x, y
        return min(max(x, 0.0), self.field[0]), min(max(y, 0.0), self.field[1])


def build_world(entry: WorldEntry) -> World:
    """Walls and obstacles of a pipeline file."""
    walls = [Wall(*wall.start, *wall.end) for wall in entry.walls]
    rounds = [Pillar(*obstacle.at, obstacle.radius) for obstacle in entry.obstacles]
    return World(walls, rounds, entry.field)


def _scan_wall(found: list[float], x: float, y: float, heading: float, wall: Wall) -> None:
    """Let the rays see `wall`: on its line, at h / cos of the angle to the line's normal."""
    from_x, from_y, to_x, to_y = wall.x1 - x, wall.y1 - y, wall.x2 - x, wall.y2 - y
    along_x, along_y = to_x - from_x, to_y - from_y
    length = hypot(along_x, along_y)
    if length < PARALLEL:
        return
    height = (from_x * along_y - from_y * along_x) / length
    if abs(height) < PARALLEL:
        return  # seen from its end: not at all
    normal = atan2(-along_x, along_y)  # of the side on which `height` is positive
    if height < 0.0:
        height, normal = -height, normal + pi
    first, last = atan2(from_y, from_x), atan2(to_y, to_x)
    span = (last - first + pi) % (2 * pi) - pi
    low, high = (first, first + span) if span >= 0.0 else (first + span, first)
    step = 2 * pi / len(found)
    for ray in range(ceil((low - heading) / step), floor((high - heading) / step) + 1):
        across = cos(heading + ray * step - normal)
        if across > 0.0 and height / across < found[ray % len(found)]:
            found[ray % len(found)] = height / across


def _scan_round(found: list[float], x: float, y: float, heading: float, thing: Pillar) -> None:
    """Let the rays see `thing`."""
    from_x, from_y = thing.x - x, thing.y - y
    away = hypot(from_x, from_y)
    if away <= thing.radius:
        found[:] = [0.0] * len(found)
        return
    middle, half = atan2(from_y, from_x), asin(thing.radius / away)
    step = 2 * pi / len(found)
    square = thing.radius * thing.radius
    for ray in range(
        ceil((middle - half - heading) / step), floor((middle + half - heading) / step) + 1
    ):
        off = heading + ray * step - middle
        aside = away * sin(off)
        far = away * cos(off) - sqrt(max(square - aside * aside, 0.0))
        if far < found[ray % len(found)]:
            found[ray % len(found)] = far


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


def to_round(x: float, y: float, ahead: float, aside: float, thing: Pillar) -> float:
    """Distance from (x, y) along the unit vector to `thing`; 0 inside it, inf when it misses."""
    from_x, from_y = thing.x - x, thing.y - y
    near = from_x * ahead + from_y * aside
    rest = from_x * from_x + from_y * from_y - thing.radius * thing.radius
    if rest <= 0.0:
        return 0.0
    square = near * near - rest
    return near - sqrt(square) if near > 0.0 and square >= 0.0 else inf
