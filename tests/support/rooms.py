"""Rooms of straight walls, what a lidar sees in them, and drives through them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from diffbotctl.mapping.lidar_scan import MappedScan
from diffbotctl.mapping.plane_pose import Array, between, compose

Wall = tuple[float, float, float, float]


def box(x: float, y: float, width: float, depth: float) -> list[Wall]:
    """Four walls around a rectangle with its lower left corner at x, y (m)."""
    right, top = x + width, y + depth
    return [(x, y, right, y), (right, y, right, top), (right, top, x, top), (x, top, x, y)]


def distances(walls: Sequence[Wall], pose: Array, bearings: Array) -> Array:
    """m, to the nearest wall along each of `bearings` (rad) from `pose`; inf without one."""
    wall = np.array(walls)
    start, along = wall[:, :2], wall[:, 2:] - wall[:, :2]
    angle = bearings[:, None] + pose[2]
    ray = np.stack([np.cos(angle), np.sin(angle)], -1)
    offset = start - pose[:2]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = ray[..., 0] * along[:, 1] - ray[..., 1] * along[:, 0]
        distance = (offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0]) / cross
        share = (offset[:, 0] * ray[..., 1] - offset[:, 1] * ray[..., 0]) / cross
    meets = (distance > 0) & (share >= 0) & (share <= 1)
    nearest: Array = np.where(meets, distance, np.inf).min(1)
    return nearest


def polyline(corners: Sequence[tuple[float, float]], step: float, turn: float) -> Iterator[Array]:
    """Poses along straight lines, `step` m apart, and `turn` rad apart at the corners."""
    pose = np.array([*corners[0], 0.0])
    for corner in corners[1:]:
        way = np.array(corner) - pose[:2]
        target = np.array([*pose[:2], np.arctan2(way[1], way[0])])
        change = between(pose, target)[2]
        count = max(1, int(np.ceil(abs(change) / turn)))
        for i in range(count):
            yield compose(pose, [0.0, 0.0, change * (i + 1) / count])
        pose = target
        length = float(np.hypot(*way))
        count = max(1, int(np.ceil(length / step)))
        for i in range(count):
            yield compose(pose, [length * (i + 1) / count, 0.0, 0.0])
        pose = np.array([*corner, pose[2]])


class Robot:
    """Scans of a robot whose lidar reaches `reach` m, and whose odometry is wrong."""

    def __init__(
        self,
        walls: Sequence[Wall],
        *,
        reach: float = 8.0,
        noise: float = 0.01,
        rays: int = 360,
        turn_scale: float = 1.02,
        distance_scale: float = 1.01,
        slip: float = 0.01,
        seed: int = 1,
    ) -> None:
        self.walls = list(walls)
        self.reach, self.noise = reach, noise
        self.bearings = 2 * np.pi * np.arange(rays) / rays
        self.scales = np.array([distance_scale, distance_scale, turn_scale])
        self.slip = slip
        self.random = np.random.default_rng(seed)
        self.number = 0
        self.odometry = np.zeros(3)
        self.covariance = np.zeros((3, 3))
        self.pose: Array | None = None

    def scan(self, pose: Array, period: float = 0.1) -> MappedScan:
        """The scan at `pose` (truth), `period` s after the one before."""
        if self.pose is not None:
            motion = between(self.pose, pose)
            size = float(np.hypot(*motion[:2]) + 0.2 * abs(motion[2]))
            sigma = self.slip * np.sqrt(size) * np.array([1.0, 0.3, 1.0])
            moved = motion * self.scales + self.random.normal(0.0, 1.0, 3) * sigma
            self.odometry = compose(self.odometry, moved)
        self.pose = np.array(pose)
        self.number += 1
        distance = distances(self.walls, self.pose, self.bearings)
        seen = distance < self.reach
        distance = np.where(seen, distance, 0.0) + self.random.normal(
            0.0, self.noise, len(distance)
        )
        ray = np.c_[np.cos(self.bearings), np.sin(self.bearings)]
        return MappedScan(
            self.number,
            self.number * period,
            (ray * distance[:, None])[seen],
            (0.0, 0.0),
            self.odometry.copy(),
            self.covariance.copy(),
            ray[~seen] * self.reach,
        )

    def drive(self, poses: Iterable[Array]) -> Iterator[MappedScan]:
        """The scan at each of `poses`."""
        return (self.scan(pose) for pose in poses)
