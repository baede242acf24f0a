"""Real lidar logs, which do not ship: scans for the mapper, and how good a map is.

`intel_scans.csv` and `intel.relations`: Intel Research Lab (Haehnel, Radish), 910 scans. A line of
scans: time s, raw odometry x, y, heading, a reference pose x, y, heading, 180 ranges in m from -90
degrees on. A line of relations: two times, x y z roll pitch yaw of the second pose in the first one
(Kuemmerle et al. 2009, "On measuring the accuracy of SLAM algorithms").

`urg_exp2.dat`: a rover with a Hokuyo URG-04LX (BreezySLAM, exp2). A line: time us, a token,
ticks of the left and right wheel, ..., from token 24 on 682 ranges in mm over 240 degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diffbotctl.mapping.lidar_scan import MappedScan
from diffbotctl.mapping.plane_pose import Array, between, compose, transformed, wrapped

INTEL_RANGE_MAX = 20.0  # m; longer ones are rays without a return
WHEEL_RADIUS, HALF_AXLE, TICKS = 0.077, 0.165, 2000  # m, m, a turn of the wheel
URG_RANGE_MAX = 4.0  # m
SCAN_PERIOD = 0.1  # s, in which the mirror turns by 360 degrees
CRISP_CELL = 0.02  # m


class Relations(NamedTuple):
    """Motions between pairs of scans, known from elsewhere."""

    first: Array
    second: Array
    motion: Array

    def errors(self, poses: Array) -> tuple[Array, Array]:
        """m and degrees by which `poses`, of all scans, deviate from each relation."""
        error = between(poses[self.first.astype(int)], poses[self.second.astype(int)])
        error = error - self.motion
        return np.hypot(error[:, 0], error[:, 1]), np.degrees(np.abs(wrapped(error[:, 2])))


def read_intel(folder: Path, reach: float = INTEL_RANGE_MAX) -> tuple[list[MappedScan], Relations]:
    """The scans, their ranges cut to `reach` m, and the relations between times of scans."""
    table = np.loadtxt(folder / "intel_scans.csv", delimiter=",")
    times, ranges = table[:, 0], table[:, 7:]
    angle = np.radians(np.arange(180) - 90.0)
    rays = np.c_[np.cos(angle), np.sin(angle)]
    scans = []
    for number, distance in enumerate(ranges):
        used = (distance > 0.05) & (distance < reach)
        points = rays[used] * distance[used, None]
        odometry = table[number, 1:4]
        scans.append(
            MappedScan(number, times[number], points, (0.0, 0.0), odometry, np.zeros((3, 3)))
        )
    relations = np.loadtxt(folder / "intel.relations")
    first = np.abs(relations[:, 0, None] - times).argmin(1)
    second = np.abs(relations[:, 1, None] - times).argmin(1)
    exact = np.abs(times[first] - relations[:, 0]) < 1e-4
    exact &= (np.abs(times[second] - relations[:, 1]) < 1e-4) & (first != second)
    motion = relations[exact][:, [2, 3, 7]]
    return scans, Relations(first[exact], second[exact], motion)


class UrgLog(NamedTuple):
    """The log of the rover."""

    times: Array
    """s"""
    poses: Array
    """odometry at `times`, headings unwrapped"""
    ranges: Array
    """m; 0 without a distance"""

    def poses_at(self, times: Array) -> Array:
        """Odometry between the lines of the log."""
        return np.stack([np.interp(times, self.times, column) for column in self.poses.T], -1)

    def scan(self, index: int, lag: float) -> MappedScan:
        """A scan whose middle is `lag` s older than its line, deskewed by the odometry."""
        count = self.ranges.shape[1]
        bearing = np.radians(240.0) * (np.arange(count) / (count - 1) - 0.5)
        distance = self.ranges[index]
        used = (distance > 0.05) & (distance < URG_RANGE_MAX)
        points = np.c_[np.cos(bearing), np.sin(bearing)][used] * distance[used, None]
        middle = self.times[index] - lag
        here = self.poses_at(np.array([middle]))[0]
        at = self.poses_at(middle + SCAN_PERIOD * bearing[used] / (2 * np.pi))
        moved = between(here, at)
        cosine, sine = np.cos(moved[:, 2]), np.sin(moved[:, 2])
        deskewed = (
            moved[:, :2]
            + np.c_[
                cosine * points[:, 0] - sine * points[:, 1],
                sine * points[:, 0] + cosine * points[:, 1],
            ]
        )
        here[2] = wrapped(here[2])
        return MappedScan(index, middle, deskewed, (0.0, 0.0), here, np.zeros((3, 3)))


def read_urg(folder: Path) -> UrgLog:
    """The log with odometry from its wheels' ticks."""
    table = np.loadtxt(folder / "urg_exp2.dat")
    ticks = table[:, 2:4] - table[0, 2:4]
    wheels = ticks * (2 * np.pi * WHEEL_RADIUS / TICKS)
    left, right = wheels.T
    heading = (right - left) / (2 * HALF_AXLE)
    step = np.diff(0.5 * (left + right))
    middle = 0.5 * (heading[1:] + heading[:-1])
    place = np.cumsum(np.c_[step * np.cos(middle), step * np.sin(middle)], 0)
    poses = np.c_[np.vstack([[0.0, 0.0], place]), heading]
    return UrgLog(table[:, 0] * 1e-6, poses, table[:, 24 : 24 + 682] * 1e-3)


def crisp_cells(scans: Sequence[MappedScan], poses: Array) -> int:
    """Cells of 2 cm that at least two points hit: the fewer, the crisper the map."""
    points = np.vstack(
        [transformed(scan.points, pose) for scan, pose in zip(scans, poses, strict=True)]
    )
    cells = np.floor(points / CRISP_CELL).astype(np.int64)
    _, count = np.unique(cells[:, 0] * 1_000_003 + cells[:, 1], return_counts=True)
    return int((count >= 2).sum())


def all_poses(kept: Sequence[MappedScan], poses: Array, scans: Sequence[MappedScan]) -> Array:
    """Poses in map of all `scans`: the others follow the odometry from one that was kept."""
    times = np.array([scan.time for scan in kept])
    found = []
    for scan in scans:
        nearest = int(np.abs(times - scan.time).argmin())
        found.append(compose(poses[nearest], between(kept[nearest].odometry, scan.odometry)))
    return np.array(found)
