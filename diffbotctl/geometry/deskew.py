"""Correction of a scan for the motion of the robot while the lidar turns, by odometry.

A lidar needs 80 to 200 ms for one turn. At 1.5 rad/s the last ray of 200 ms is measured 17 degrees
further than the first. Each ray is moved to where it would have been seen from in the middle of
the turn: from there the motion to either end is shortest, and so is the error of the odometry.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from math import cos, inf, remainder, sin, tau
from typing import NamedTuple

from diffbotctl.geometry.footprint import Footprint, arc_motion, ray_directions
from diffbotctl.messages import Odometry, Scan
from diffbotctl.time import SECOND

HISTORY = SECOND  # ns of odometry that are kept: a turn, and the lag of a scan
EXTRAPOLATION_MAX = SECOND // 5  # ns beyond the newest odometry

PlanePose = tuple[float, float, float]  # x, y in m, heading in rad


class PoseHistory:
    """The poses of the last second, in odom."""

    def __init__(self) -> None:
        self.poses: deque[Odometry] = deque()

    def add(self, odometry: Odometry) -> None:
        """Take the newest pose; one that is not newer than the last is ignored."""
        poses = self.poses
        if poses and odometry.time <= poses[-1].time:
            return
        poses.append(odometry)
        while odometry.time - poses[0].time > HISTORY:
            poses.popleft()

    def covers(self, first: int, last: int) -> bool:
        """Whether the poses from `first` to `last` (ns) are known, extrapolated where it is near.

        Before the first pose the robot has not moved.
        """
        poses = self.poses
        return bool(poses) and last <= poses[-1].time + EXTRAPOLATION_MAX and first <= last

    def at(self, time: int) -> Odometry:
        """The pose at `time` (ns): between two poses evenly, beyond the last along its arc."""
        poses = self.poses
        after = bisect_right(poses, time, key=lambda pose: pose.time)
        if after == len(poses):
            last = poses[-1]
            x, y, turn = arc_motion(last.linear, last.angular, (time - last.time) / SECOND)
            c, s = cos(last.heading), sin(last.heading)
            place = (last.x + c * x - s * y, last.y + s * x + c * y, last.heading + turn)
            return last._replace(time=time, x=place[0], y=place[1], heading=place[2])
        if after == 0:
            return poses[0]._replace(time=time)
        first, second = poses[after - 1], poses[after]
        share = (time - first.time) / (second.time - first.time)
        return second._replace(
            time=time,
            x=first.x + share * (second.x - first.x),
            y=first.y + share * (second.y - first.y),
            heading=first.heading + share * (second.heading - first.heading),
            linear=first.linear + share * (second.linear - first.linear),
            angular=first.angular + share * (second.angular - first.angular),
        )

    def knots(self, first: int, last: int) -> list[Odometry]:
        """The poses at `first`, at `last`, and all that are known between them."""
        between = [pose for pose in self.poses if first < pose.time < last]
        return [self.at(first), *between, self.at(last)]


class DeskewedScan(NamedTuple):
    """Points in base_link at the pose `at`, in the order of the rays: x, y, concatenated (m)."""

    at: Odometry
    origin: tuple[float, float]
    points: tuple[float, ...]
    clear: tuple[float, ...]


def deskew(
    scan: Scan,
    lag: int,
    mount: PlanePose,
    outline: Footprint,
    history: PoseHistory,
    clear_distance: float,
) -> DeskewedScan:
    """`scan`, whose times are `lag` (ns) too late, as points seen from the middle of its turn.

    `mount`: pose of the lidar in base_link. Points within `outline` are parts of the robot.
    `clear_distance` (m): how far a ray went that met nothing.
    """
    turn = round(SECOND * scan.duration)
    end = scan.time - lag
    begin, middle = end - turn, end - turn // 2
    at = history.at(middle)
    knots = [_in_frame(pose, at) for pose in history.knots(begin, end)]
    rays = len(scan.distances)
    directions = ray_directions(scan.start + mount[2], scan.step, rays)
    spacing = turn / rays if rays else 0.0
    front, back, half = outline.front, outline.back, outline.half
    mount_x, mount_y, _ = mount
    points: list[float] = []
    clear: list[float] = []
    segment = 0
    for ray, far in enumerate(scan.distances):
        if far <= 0.0:
            continue
        time = begin + ray * spacing
        while segment < len(knots) - 2 and time >= knots[segment + 1][0]:
            segment += 1
        first, second = knots[segment], knots[segment + 1]
        span = second[0] - first[0]
        share = (time - first[0]) / span if span else 0.0
        c, s = directions[ray]
        is_clear = far == inf
        if is_clear:
            far = clear_distance
        x, y = mount_x + far * c, mount_y + far * s
        if -back <= x <= front and -half <= y <= half:
            continue
        heading = first[3] + share * (second[3] - first[3])
        c, s = cos(heading), sin(heading)
        px = first[1] + share * (second[1] - first[1]) + c * x - s * y
        py = first[2] + share * (second[2] - first[2]) + s * x + c * y
        (clear if is_clear else points).extend((round(px, 4), round(py, 4)))
    return DeskewedScan(at, (mount_x, mount_y), tuple(points), tuple(clear))


def _in_frame(pose: Odometry, frame: Odometry) -> tuple[int, float, float, float]:
    """Time (ns), x, y and heading of `pose` in the frame of base_link at `frame`."""
    dx, dy = pose.x - frame.x, pose.y - frame.y
    c, s = cos(frame.heading), sin(frame.heading)
    turn = pose.heading - frame.heading
    return pose.time, c * dx + s * dy, c * dy - s * dx, turn


def compose(first: PlanePose, second: PlanePose) -> PlanePose:
    """The pose `second`, given in the frame of `first`, in the frame that `first` is given in."""
    c, s = cos(first[2]), sin(first[2])
    return (
        first[0] + c * second[0] - s * second[1],
        first[1] + s * second[0] + c * second[1],
        remainder(first[2] + second[2], tau),
    )
