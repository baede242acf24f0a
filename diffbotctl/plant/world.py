"""Walls and round obstacles around the simulated robot, and ray casting. Metres."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, ceil, cos, floor, hypot, inf, pi, sin, sqrt
from typing import NamedTuple

from diffbotctl.config.configuration import WorldEntry

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


class World:
    """The obstacles that distance sensors detect and the field that limits the robot."""

    def __init__(
        self,
        walls: Sequence[Wall] = (),
        pillars: Sequence[Pillar] = (),
        field: tuple[float, float] | None = None,
    ) -> None:
        """`field`: width and depth, from (0, 0), of a walled field that the robot cannot leave."""
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
        world = World(self.walls, [*self.pillars, *pillars])
        world.field = self.field  # whose walls are among them already
        return world

    @property
    def empty(self) -> bool:
        """True without any obstacle."""
        return not self.walls and not self.pillars

    def distance(self, x: float, y: float, bearing: float) -> float:
        """Distance (m) along `bearing` (rad) from (x, y) to the nearest obstacle; inf if clear."""
        c, s = cos(bearing), sin(bearing)
        nearest = inf
        for wall in self.walls:
            nearest = min(nearest, to_wall(x, y, c, s, wall))
        for pillar in self.pillars:
            nearest = min(nearest, to_pillar(x, y, c, s, pillar))
        return nearest

    def scan(self, x: float, y: float, heading: float, rays: int) -> list[float]:
        """Distances (m) from (x, y) along `rays` evenly spaced bearings, from `heading` (rad).

        As `distance` along each, but each obstacle is tested only against rays that can meet it.
        """
        distances = [inf] * rays
        for wall in self.walls:
            _scan_wall(distances, x, y, heading, wall)
        for pillar in self.pillars:
            _scan_pillar(distances, x, y, heading, pillar)
        return distances

    def kept(self, x: float, y: float) -> tuple[float, float]:
        """(x, y), or the nearest point inside the field."""
        if self.field is None:
            return x, y
        return min(max(x, 0.0), self.field[0]), min(max(y, 0.0), self.field[1])


def build_world(entry: WorldEntry) -> World:
    """Walls and obstacles of a pipeline file."""
    walls = [Wall(*wall.start, *wall.end) for wall in entry.walls]
    pillars = [Pillar(*obstacle.at, obstacle.radius) for obstacle in entry.obstacles]
    return World(walls, pillars, entry.field)


def _scan_wall(distances: list[float], x: float, y: float, heading: float, wall: Wall) -> None:
    """Shorten the rays that meet `wall`: h / cos of the angle to the normal of its line."""
    from_x, from_y, to_x, to_y = wall.x1 - x, wall.y1 - y, wall.x2 - x, wall.y2 - y
    along_x, along_y = to_x - from_x, to_y - from_y
    length = hypot(along_x, along_y)
    if length < PARALLEL_MAX:
        return
    height = (from_x * along_y - from_y * along_x) / length
    if abs(height) < PARALLEL_MAX:
        return  # seen end-on: not at all
    normal = atan2(-along_x, along_y)  # of the side on which `height` is positive
    if height < 0.0:
        height, normal = -height, normal + pi
    first, last = atan2(from_y, from_x), atan2(to_y, to_x)
    span = (last - first + pi) % (2 * pi) - pi
    low, high = (first, first + span) if span >= 0.0 else (first + span, first)
    rays = len(distances)
    step = 2 * pi / rays
    for ray in range(ceil((low - heading) / step), floor((high - heading) / step) + 1):
        across = cos(heading + ray * step - normal)
        if across > 0.0:
            distance = height / across
            if distance < distances[ray % rays]:
                distances[ray % rays] = distance


def _scan_pillar(
    distances: list[float], x: float, y: float, heading: float, pillar: Pillar
) -> None:
    """Shorten the rays that meet `pillar`."""
    from_x, from_y = pillar.x - x, pillar.y - y
    center = hypot(from_x, from_y)
    if center <= pillar.radius:
        distances[:] = [0.0] * len(distances)
        return
    middle, half = atan2(from_y, from_x), asin(pillar.radius / center)
    rays = len(distances)
    step = 2 * pi / rays
    radius_squared = pillar.radius * pillar.radius
    low, high = middle - half - heading, middle + half - heading
    for ray in range(ceil(low / step), floor(high / step) + 1):
        angle = heading + ray * step - middle
        offset = center * sin(angle)
        distance = center * cos(angle) - sqrt(max(radius_squared - offset * offset, 0.0))
        if distance < distances[ray % rays]:
            distances[ray % rays] = distance


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
