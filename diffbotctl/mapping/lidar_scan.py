"""Scans of a lidar as points of the robot, and the direction of the surfaces that they lie on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diffbotctl.mapping.plane_pose import Array, Points

BASELINES = (1, 2, 4)  # rays to either side; the longest along which the surface is straight
GAP_ANGLE = 0.12  # rad a ray; points further apart, as seen from the lidar, are two surfaces
GAP_MIN = 0.12  # m, a ray; nearer points are of one surface, whatever the angle
BEND_MIN, BEND_RATIO = 0.02, 0.008  # m and a metre: noise of a point beside the line through two
NO_POINTS = np.zeros((0, 2))


class MappedScan(NamedTuple):
    """One turn of a lidar, as if all of it had been measured at `time`."""

    number: int
    """counts up; a scan that is not newer than the last one is ignored"""
    time: float
    """s"""
    points: Points
    """N x 2, m, in base_link at `time`, in the order in which the lidar measured them"""
    origin: tuple[float, float]
    """m, of the lidar in base_link"""
    odometry: Array
    """x, y, heading of base_link in odom at `time`"""
    covariance: Array
    """3 x 3, of `odometry`, along the axes of odom"""
    clear: Points = NO_POINTS
    """M x 2: how far rays went that met nothing, in base_link"""


class SurfacePoints(NamedTuple):
    """Points, and the surfaces that they lie on."""

    points: Array
    """N x 2, m"""
    normals: Array
    """N x 2, of length 1; 0 where the direction is unknown"""
    is_flat: NDArray[np.bool_]
    """whether the direction is known"""


def surface_points(measured: Points, origin: tuple[float, float]) -> SurfacePoints:
    """Directions of the surfaces from the neighbours of each point.

    `measured`: N x 2 in the order of measurement; `origin`: the lidar in the same frame.
    """
    points, count = measured.astype(float), len(measured)
    normals = np.zeros((count, 2))
    is_flat = np.zeros(count, bool)
    distance = np.hypot(*(points - origin).T)
    for step in BASELINES:
        if count <= 2 * step:
            break
        before, here, after = points[: -2 * step], points[step:-step], points[2 * step :]
        along = after - before
        length = np.hypot(*along.T)
        offset = here - before
        gap = step * np.maximum(GAP_MIN, GAP_ANGLE * distance[step:-step])
        bend = np.abs(along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0])
        straight = (np.hypot(*offset.T) < gap) & (np.hypot(*(after - here).T) < gap)
        straight &= length > 1e-3
        straight &= bend < length * (BEND_MIN + BEND_RATIO * distance[step:-step])
        place = np.flatnonzero(straight) + step
        normals[place] = (np.c_[-along[:, 1], along[:, 0]] / np.maximum(length, 1e-9)[:, None])[
            straight
        ]
        is_flat[place] = True
    return SurfacePoints(points, normals, is_flat)
