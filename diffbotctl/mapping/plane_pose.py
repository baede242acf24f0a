"""Poses in the plane, (x, y, heading) in m and rad, alone or one in each row of an array.

Covariances are those of small motions in the frame of the pose itself: true pose = pose * motion
(Barfoot and Furgale 2014, "Associating uncertainty with three-dimensional poses").
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Points = NDArray[np.float64 | np.float32]  # those that are kept are in single precision


def wrapped(angle: Array) -> Array:
    """Angles in rad, from -pi up to pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def compose(first: ArrayLike, second: ArrayLike) -> Array:
    """The pose `second`, given in the frame of `first`, in the frame that `first` is given in."""
    a, b = np.asarray(first, float), np.asarray(second, float)
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = a[..., 0] + c * b[..., 0] - s * b[..., 1]
    y = a[..., 1] + s * b[..., 0] + c * b[..., 1]
    return np.stack([x, y, wrapped(a[..., 2] + b[..., 2])], -1)


def between(first: ArrayLike, second: ArrayLike) -> Array:
    """The pose `second` in the frame of `first`."""
    a, b = np.asarray(first, float), np.asarray(second, float)
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    return np.stack([c * dx + s * dy, c * dy - s * dx, wrapped(b[..., 2] - a[..., 2])], -1)


def inverse(pose: ArrayLike) -> Array:
    """The origin in the frame of `pose`."""
    return between(pose, np.zeros(3))


def transformed(points: Points, pose: Array) -> Array:
    """Points (N x 2) in the frame of `pose`, in the frame that `pose` is given in."""
    return rotated(points, float(pose[2])) + pose[:2]


def rotated(vectors: Points, angle: float) -> Array:
    """Vectors (N x 2), turned counter-clockwise by `angle` (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    turned: Array = vectors @ np.array([[c, s], [-s, c]])
    return turned


def adjoint(pose: Array) -> Array:
    """3 x 3: small motions in the frame of `pose`, as those of the frame it is given in."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[1]], [s, c, -pose[0]], [0.0, 0.0, 1.0]])


def moved_covariance(covariance: Array, motion: Array) -> Array:
    """Covariance of a pose after an exactly known `motion`, in the frame after it."""
    change = adjoint(inverse(motion))
    moved: Array = change @ covariance @ change.T
    return moved


def rotated_covariance(covariance: Array, angle: float) -> Array:
    """`covariance` with its x and y along axes that are turned by -`angle` (rad)."""
    turn = adjoint(np.array([0.0, 0.0, angle]))
    turned: Array = turn @ covariance @ turn.T
    return turned


def apart(first: Array, second: Array, limits: tuple[float, float]) -> bool:
    """Whether two poses are more than `limits` (m, rad) apart."""
    distance = np.hypot(second[0] - first[0], second[1] - first[1])
    return bool(distance > limits[0] or abs(wrapped(second[2] - first[2])) > limits[1])
