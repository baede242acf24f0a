"""Walls and round obstacles around the simulated robot, and ray casting. Metres."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import asin, atan2, cos, hypot, inf, pi, radians, remainder, sin, sqrt
from typing import NamedTuple

from diffbotctl.config.configuration import WorldEntry

GLASS_COSINE = cos(radians(15))  # of the angle to the normal at which glass returns a ray
PARALLEL_MAX = 1e-12  # m; a wall at this distance from a parallel ray is seen end-on: not at all


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


class MovingPillar(NamedTuple):
    """A round obstacle that moves along `points` from `begin` (s) on, at `speed` (m/s)."""

    radius: float
    points: tuple[tuple[float, float], ...]
    begin: float
    speed: float
    repeats: bool

    def at(self, time: float) -> Pillar:
        """Where it is at `time` (s)."""
        way = max(0.0, time - self.begin) * self.speed
        legs = list(pairwise((*self.points, self.points[0]) if self.repeats else self.points))
        lengths = [hypot(x2 - x1, y2 - y1) for (x1, y1), (x2, y2) in legs]
        whole = sum(lengths, 0.0)
        if self.repeats and whole > 0.0:
            way %= whole
        for ((x1, y1), (x2, y2)), length in zip(legs, lengths, strict=True):
            if way < length:
                share = way / length
                return Pillar(x1 + share * (x2 - x1), y1 + share * (y2 - y1), self.radius)
            way -= length
        return Pillar(*self.points[0 if self.repeats else -1], self.radius)


class World:
    """The obstacles that distance sensors detect and the field that limits the robot."""

    def __init__(
        self,
        walls: Sequence[Wall] = (),
        pillars: Sequence[Pillar] = (),
        field: tuple[float, float] | None = None,
        glass: Iterable[Wall] = (),
        moving: Sequence[MovingPillar] = (),
    ) -> None:
        """`field`: width and depth, from (0, 0), of a walled field that the robot cannot leave.

        `glass`: those of `walls` through which light passes.
        """
        self.glass = frozenset(glass)
        self.moving = tuple(moving)
        self.pillars = tuple(pillars)
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

    def with_pillars(self, pillars: Sequence[Pillar]) -> World:
        """The same with further round obstacles."""
        world = World(self.walls, [*self.pillars, *pillars], None, self.glass, self.moving)
        world.field = self.field  # whose walls are among them already
        return world

    def at(self, time: float) -> World:
        """The same at `time` (s), with what moves where it is then."""
        if not self.moving:
            return self
        pillars = [*self.pillars, *(each.at(time) for each in self.moving)]
        world = World(self.walls, pillars, None, self.glass)
        world.field = self.field
        return world

    @property
    def empty(self) -> bool:
        """True without any obstacle."""
        return not self.walls and not self.pillars and not self.moving

    def distance(self, x: float, y: float, bearing: float, is_light: bool = True) -> float:
        """Distance (m) along `bearing` (rad) from (x, y) to the nearest obstacle; inf if clear.

        `is_light`: glass is met only near its normal; sound is reflected by it as by any wall.
        """
        c, s = cos(bearing), sin(bearing)
        nearest = inf
        for wall in self.walls:
            if is_light and self.glass and wall in self.glass and _passes(c, s, wall):
                continue
            nearest = min(nearest, to_wall(x, y, c, s, wall))
        for pillar in self.pillars:
            nearest = min(nearest, to_pillar(x, y, c, s, pillar))
        return nearest

    def towards(self, x: float, y: float, bearing: float, half: float) -> World:
        """The obstacles that rays from (x, y) within `half` of `bearing` (rad) may meet."""
        walls = [wall for wall in self.walls if _wall_offset(x, y, bearing, wall) <= half]
        pillars = [each for each in self.pillars if _pillar_offset(x, y, bearing, each) <= half]
        return World(walls, pillars, None, self.glass)

    def kept(self, x: float, y: float) -> tuple[float, float]:
        """(x, y), or the nearest point inside the field."""
        if self.field is None:
            return x, y
        return min(max(x, 0.0), self.field[0]), min(max(y, 0.0), self.field[1])


def build_world(entry: WorldEntry) -> World:
    """Walls and obstacles of a pipeline file."""
    walls = [Wall(*wall.start, *wall.end) for wall in entry.walls]
    glass = [wall for wall, written in zip(walls, entry.walls, strict=True) if written.glass]
    pillars = [Pillar(*each.at, each.radius) for each in entry.obstacles if not each.path]
    moving = [
        MovingPillar(each.radius, (each.at, *each.path), each.begin, each.speed, each.repeat)
        for each in entry.obstacles
        if each.path
    ]
    return World(walls, pillars, entry.field, glass, moving)


def _passes(c: float, s: float, wall: Wall) -> bool:
    """Whether light along the unit vector (c, s) passes through a wall of glass."""
    along_x, along_y = wall.x2 - wall.x1, wall.y2 - wall.y1
    return abs(c * along_y - s * along_x) < GLASS_COSINE * hypot(along_x, along_y)


def _wall_offset(x: float, y: float, bearing: float, wall: Wall) -> float:
    """Angle (rad) from `bearing` to what is seen of `wall` from (x, y); below 0 within it."""
    first = atan2(wall.y1 - y, wall.x1 - x)
    half = 0.5 * remainder(atan2(wall.y2 - y, wall.x2 - x) - first, 2 * pi)
    return abs(remainder(first + half - bearing, 2 * pi)) - abs(half)


def _pillar_offset(x: float, y: float, bearing: float, pillar: Pillar) -> float:
    """As `_wall_offset`, of a pillar; it is everywhere for what is in it."""
    from_x, from_y = pillar.x - x, pillar.y - y
    center = hypot(from_x, from_y)
    half = asin(pillar.radius / center) if center > pillar.radius else pi
    return abs(remainder(atan2(from_y, from_x) - bearing, 2 * pi)) - half


def to_wall(x: float, y: float, c: float, s: float, wall: Wall) -> float:
    """Distance from (x, y) along the unit vector (c, s) to `wall`; inf when it misses."""
    along_x, along_y = wall.x2 - wall.x1, wall.y2 - wall.y1
    cross = c * along_y - s * along_x
    if abs(cross) < PARALLEL_MAX:
        return inf
    from_x, from_y = wall.x1 - x, wall.y1 - y
    ratio = (from_x * s - from_y * c) / cross
    distance = (from_x * along_y - from_y * along_x) / cross
    return distance if 0.0 <= ratio <= 1.0 and distance >= 0.0 else inf


def to_pillar(x: float, y: float, c: float, s: float, pillar: Pillar) -> float:
    """Distance from (x, y) along the unit vector to `pillar`; 0 inside it, inf when it misses."""
    from_x, from_y = pillar.x - x, pillar.y - y
    along = from_x * c + from_y * s
    tangent_squared = from_x * from_x + from_y * from_y - pillar.radius * pillar.radius
    if tangent_squared <= 0.0:
        return 0.0
    half_chord_squared = along * along - tangent_squared
    return along - sqrt(half_chord_squared) if along > 0.0 and half_chord_squared >= 0.0 else inf
