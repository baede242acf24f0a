"""The outline of the robot, points around it, and motion along arcs. Metres, radians, base_link."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import cos, hypot, sin
from typing import NamedTuple, Protocol

from diffbotctl.geometry.lidars import LIDARS

Point = tuple[float, float]


class Footprint(NamedTuple):
    """The rectangular outline; the origin is the middle of the axle."""

    front: float
    back: float
    half: float  # of the width

    @property
    def reach(self) -> float:
        """Distance of the farthest corner: radius of the circle that a turn on the spot needs."""
        return hypot(max(self.front, self.back), self.half)

    def clearance(self, x: float, y: float) -> float:
        """Distance from the point (x, y) to the outline; 0 inside."""
        ahead = max(-self.back - x, x - self.front, 0.0)
        aside = max(abs(y) - self.half, 0.0)
        return hypot(ahead, aside)

    def crosses(self, start: Point, end: Point) -> bool:
        """Whether the segment from `start` to `end` enters the outline (Liang and Barsky, 1984)."""
        first, last = 0.0, 1.0
        for begin, finish, low, high in (
            (start[0], end[0], -self.back, self.front),
            (start[1], end[1], -self.half, self.half),
        ):
            along = finish - begin
            if along == 0.0:
                if not low < begin < high:
                    return False
                continue
            ends = sorted(((low - begin) / along, (high - begin) / along))
            first, last = max(first, ends[0]), min(last, ends[1])
        return first < last

    def near(self, points: list[Point], limit: float) -> list[Point]:
        """The points within `limit` (m) of the outline."""
        low, high, half = -self.back - limit, self.front + limit, self.half + limit
        return [
            (x, y)
            for x, y in points
            if low < x < high and -half < y < half and self.clearance(x, y) < limit
        ]


class Mount(Protocol):
    """Pose of a device in base_link, in the robot file."""

    x: float
    y: float
    heading: float


class MountedDevice(Protocol):
    """A sensor section of the robot file."""

    type: str
    at: Mount


def sensor_mount(sensors: Mapping[str, MountedDevice], name: str) -> tuple[float, float, float]:
    """Pose (m, rad) of a sensor in base_link; the origin if the robot has no such sensor."""
    sensor = sensors.get(name)
    return (sensor.at.x, sensor.at.y, sensor.at.heading) if sensor else (0.0, 0.0, 0.0)


def scanner_near(sensors: Mapping[str, MountedDevice], name: str) -> float:
    """Distance (m) below which an object is too close for a lidar; the largest if unknown."""
    model = LIDARS.get(sensors[name].type) if name in sensors else None
    return model.near if model else max(lidar.near for lidar in LIDARS.values())


class PointTracker:
    """Pose of the robot in a local frame, integrated from its velocity along exact arcs.

    Unlike the odometry pose it never jumps. Times in ns.
    """

    def __init__(self) -> None:
        self.x = self.y = self.heading = 0.0
        self.linear = self.angular = 0.0
        self.time: int | None = None

    def update(self, time: int, linear: float, angular: float) -> None:
        """Set the velocity (m/s, rad/s) measured at `time`."""
        if self.time is not None and time > self.time:
            self.x, self.y, self.heading = self.pose_at(time)
        self.time, self.linear, self.angular = time, linear, angular

    def pose_at(self, time: int) -> tuple[float, float, float]:
        """The pose (m, m, rad) at `time`, near the time of the last velocity."""
        seconds = 0.0 if self.time is None else (time - self.time) * 1e-9
        x, y, turn = arc_motion(self.linear, self.angular, seconds)
        ahead, aside = cos(self.heading), sin(self.heading)
        return (
            self.x + x * ahead - y * aside,
            self.y + x * aside + y * ahead,
            self.heading + turn,
        )


def arc_motion(linear: float, angular: float, seconds: float) -> tuple[float, float, float]:
    """Motion (x, y, turn) in the starting frame after `seconds` at constant velocity (m/s, rad/s).

    The chord of an arc of angle 2h has sin(h)/h times the arc's length and the direction h.
    """
    half = 0.5 * angular * seconds
    chord = linear * seconds * (sin(half) / half if half else 1.0)
    return chord * cos(half), chord * sin(half), 2.0 * half


def distance_to_segment(x: float, y: float, x1: float, y1: float, x2: float, y2: float) -> float:
    """Distance (m) from the point (x, y) to the line segment from (x1, y1) to (x2, y2)."""
    along_x, along_y = x2 - x1, y2 - y1
    from_x, from_y = x - x1, y - y1
    length_squared = along_x * along_x + along_y * along_y
    ratio = (from_x * along_x + from_y * along_y) / length_squared if length_squared else 0.0
    ratio = min(max(ratio, 0.0), 1.0)
    return hypot(from_x - ratio * along_x, from_y - ratio * along_y)


def into_frame(points: list[Point], x: float, y: float, heading: float) -> list[Point]:
    """Transform `points` from the outer frame into the frame at (x, y, heading)."""
    ahead, aside = cos(heading), sin(heading)
    return [
        ((px - x) * ahead + (py - y) * aside, (py - y) * ahead - (px - x) * aside)
        for px, py in points
    ]


def out_of_frame(points: list[Point], x: float, y: float, heading: float) -> list[Point]:
    """Transform `points` from the frame at (x, y, heading) into the outer frame."""
    ahead, aside = cos(heading), sin(heading)
    return [(x + px * ahead - py * aside, y + px * aside + py * ahead) for px, py in points]


def scan_points(
    start: float, step: float, distances: tuple[float, ...], nearest: float, within: float
) -> list[tuple[int, Point]]:
    """The points of a scan nearer than `within` (m), in the frame of the scanner, with their ray.

    A distance of 0 means too close to measure and is replaced by `nearest` (m).
    """
    directions = ray_directions(start, step, len(distances))
    return [
        (ray, (far * c, far * s) if far > 0.0 else (nearest * c, nearest * s))
        for ray, (far, (c, s)) in enumerate(zip(distances, directions, strict=True))
        if far <= within
    ]


@lru_cache(maxsize=8)  # a scanner's rays have the same directions in every turn
def ray_directions(start: float, step: float, rays: int) -> tuple[Point, ...]:
    """Unit vectors of `rays` bearings, `step` apart from `start` (rad)."""
    bearings = [start + ray * step for ray in range(rays)]
    return tuple((cos(bearing), sin(bearing)) for bearing in bearings)
