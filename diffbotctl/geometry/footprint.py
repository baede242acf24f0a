"""The robot's outline on the floor, and how near points come to it. Metres, in base_link."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, hypot, sin
from typing import NamedTuple, Protocol

Point = tuple[float, float]


class Footprint(NamedTuple):
    """A rectangle about the middle of the axle."""

    front: float
    back: float
    half: float  # of its width

    @property
    def reach(self) -> float:
        """How far from the axle its farthest corner is: the circle it needs to turn on the spot."""
        return hypot(max(self.front, self.back), self.half)

    def clearance(self, x: float, y: float) -> float:
        """Distance from the point (x, y) to the outline; 0 inside."""
        ahead = max(-self.back - x, x - self.front, 0.0)
        aside = max(abs(y) - self.half, 0.0)
        return hypot(ahead, aside)


class Mount(Protocol):
    """Where a device sits in base_link, as the robot file has it."""

    x: float
    y: float
    heading: float


class MountedDevice(Protocol):
    """A sensor of the robot file."""

    at: Mount


def sensor_mount(sensors: Mapping[str, MountedDevice], name: str) -> tuple[float, float, float]:
    """Pose (m, rad) of a sensor in base_link; the origin for one that the robot does not have."""
    sensor = sensors.get(name)
    return (sensor.at.x, sensor.at.y, sensor.at.heading) if sensor else (0.0, 0.0, 0.0)


class PointTracker:
    """Where the robot is in a frame of its own, from its velocity: jumps of a pose do not matter.

    Exact arcs, so that a turn on the spot moves nothing. Times in ns.
    """

    def __init__(self) -> None:
        self.x = self.y = self.heading = 0.0
        self.linear = self.angular = 0.0
        self.time: int | None = None

    def update(self, time: int, linear: float, angular: float) -> None:
        """Take in the velocity (m/s, rad/s) that was true at `time`."""
        if self.time is not None and time > self.time:
            self.x, self.y, self.heading = self.pose_at(time)
        self.time, self.linear, self.angular = time, linear, angular

    def pose_at(self, time: int) -> tuple[float, float, float]:
        """The pose at `time`, a little before or after the last velocity."""
        seconds = 0.0 if self.time is None else (time - self.time) * 1e-9
        x, y, turn = arc_motion(self.linear, self.angular, seconds)
        ahead, aside = cos(self.heading), sin(self.heading)
        return (
            self.x + x * ahead - y * aside,
            self.y + x * aside + y * ahead,
            self.heading + turn,
        )


def arc_motion(linear: float, angular: float, seconds: float) -> tuple[float, float, float]:
    """Where a steady velocity leads in `seconds`, as (x, y, turn) in the frame of the start.

    The chord of an arc: its length by sin(h)/h, its direction half the turn.
    """
    half = 0.5 * angular * seconds
    chord = linear * seconds * (sin(half) / half if half else 1.0)
    return chord * cos(half), chord * sin(half), 2.0 * half


def into_frame(points: list[Point], x: float, y: float, heading: float) -> list[Point]:
    """`points` as the frame at (x, y, heading) has them."""
    ahead, aside = cos(heading), sin(heading)
    return [
        ((px - x) * ahead + (py - y) * aside, (py - y) * ahead - (px - x) * aside)
        for px, py in points
    ]


def out_of_frame(points: list[Point], x: float, y: float, heading: float) -> list[Point]:
    """Points of the frame at (x, y, heading), as the frame around it has them."""
    ahead, aside = cos(heading), sin(heading)
    return [(x + px * ahead - py * aside, y + px * aside + py * ahead) for px, py in points]


def scan_points(
    start: float, step: float, distances: tuple[float, ...], nearest: float, within: float
) -> list[Point]:
    """The things that a scan sees within `within`, as points in the scanner's frame.

    A distance of 0, too close to measure, is taken for one of `nearest`.
    """
    return [
        (max(far, nearest) * cos(start + i * step), max(far, nearest) * sin(start + i * step))
        for i, far in enumerate(distances)
        if far <= within
    ]
