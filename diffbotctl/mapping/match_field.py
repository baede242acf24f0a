"""The nearest point of a map for each cell of a raster, and how likely a ray ends there.

One structure serves the search for a pose (likelihood field, Thrun, Burgard and Fox 2005, 6.4) and
its refinement (nearest point). Likelihoods are integers, so that sums do not depend on their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from diffbotctl.mapping.lidar_scan import SurfacePoints
from diffbotctl.mapping.plane_pose import Array, rotated, transformed

CELL = 0.05  # m
REACH = 0.30  # m; a point has no influence further away
SIGMA = 0.08  # m, of the likelihood
FULL = 200  # likelihood on a point
MARGIN = 8  # empty cells around the points; cell 0 stands for everything outside
FACINGS = 8  # directions of surfaces whose points in a cell are averaged
LEVELS = 5  # coarser rasters of `pyramid`; a cell of the last one spans 2**LEVELS cells
PAD = 2**LEVELS  # empty cells before the first row and column of `pyramid`


@cache
def _neighbours() -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Offsets in cells (K x 2) within REACH, the furthest first, and their likelihoods."""
    radius = round(REACH / CELL)
    axis = np.arange(-radius, radius + 1)
    offsets = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    distance = CELL * np.hypot(*offsets.T)
    order = np.argsort(-distance, kind="stable")
    order = order[distance[order] <= REACH]
    likelihood = FULL * np.exp(-0.5 * (distance[order] / SIGMA) ** 2)
    return offsets[order], np.rint(likelihood).astype(np.uint8)


class MatchField:
    """Raster around `surface`: index of the nearest point, and likelihood (0 to FULL)."""

    def __init__(self, surface: SurfacePoints) -> None:
        self.surface = surface
        points = surface.points
        low = points.min(0) if len(points) else np.zeros(2)
        high = points.max(0) if len(points) else np.zeros(2)
        self.low = (np.floor(low / CELL) - MARGIN) * CELL
        self.rows, self.columns = np.ceil((high - self.low) / CELL).astype(int) + MARGIN + 1
        self.nearest = np.full(self.rows * self.columns, -1, np.int32)
        self.likelihood = np.zeros(self.rows * self.columns, np.uint8)
        if len(points):
            self._fill(points, surface.is_flat)

    def _fill(self, points: Array, is_flat: NDArray[np.bool_]) -> None:
        place = np.floor((points - self.low) / CELL).astype(np.int64)
        cell = place[:, 0] * self.columns + place[:, 1]
        # One point stands for a cell: a flat one where there is one, of these the last.
        order = np.argsort(is_flat, kind="stable")
        self.nearest[cell[order]] = order
        occupied = np.flatnonzero(self.nearest >= 0)
        point = self.nearest[occupied]
        offsets, likelihoods = _neighbours()
        for (row, column), likelihood in zip(offsets.tolist(), likelihoods, strict=True):
            shifted = occupied + (row * self.columns + column)
            self.nearest[shifted] = point
            self.likelihood[shifted] = likelihood

    def cells(self, points: Array) -> NDArray[np.int64]:
        """Index of the cell of each point (N x 2); 0, which is empty, outside the raster."""
        place = np.floor((points - self.low) * (1 / CELL)).astype(np.int64)
        inside = (place >= 0).all(1) & (place[:, 0] < self.rows) & (place[:, 1] < self.columns)
        return np.where(inside, place[:, 0] * self.columns + place[:, 1], 0)

    @cached_property
    def pyramid(self) -> list[NDArray[np.uint8]]:
        """Rasters whose cells hold the highest likelihood of the next 2**level cells on both axes.

        Hess et al. 2016, "Real-time loop closure in 2D LIDAR SLAM", section V.
        """
        finest = np.zeros((self.rows + PAD, self.columns + PAD), np.uint8)
        finest[PAD:, PAD:] = self.likelihood.reshape(self.rows, self.columns)
        levels = [finest]
        for level in range(LEVELS):
            shift = 2**level
            wide = levels[-1].copy()
            np.maximum(wide[:-shift], levels[-1][shift:], out=wide[:-shift])
            high = wide.copy()
            np.maximum(high[:, :-shift], wide[:, shift:], out=high[:, :-shift])
            levels.append(high)
        return levels


def joined(surfaces: Sequence[SurfacePoints], poses: Array) -> SurfacePoints:
    """The points of all, averaged, in the frame that `poses`, one for each, are given in."""
    pairs = list(zip(surfaces, poses, strict=True))
    return _averaged(
        SurfacePoints(
            np.vstack([transformed(each.points, pose) for each, pose in pairs]),
            np.vstack([rotated(each.normals, pose[2]) for each, pose in pairs]),
            np.concatenate([each.is_flat for each in surfaces]),
        )
    )


def _averaged(surface: SurfacePoints) -> SurfacePoints:
    """One point for all in a cell whose surfaces face the same eighth of a turn.

    Those of many points come last. Averages have less noise than single points.
    """
    cell = np.floor(surface.points / CELL).astype(np.int64)
    facing = np.arctan2(surface.normals[:, 1], surface.normals[:, 0]) * (FACINGS / (2 * np.pi))
    facing = np.where(surface.is_flat, np.floor(facing).astype(np.int64) % FACINGS, FACINGS)
    key = (cell[:, 0] * 1_000_003 + cell[:, 1]) * (FACINGS + 1) + facing
    _, first, group, count = np.unique(
        key, return_index=True, return_inverse=True, return_counts=True
    )
    values = [*surface.points.T, *surface.normals.T]
    sums: Array = np.column_stack([np.bincount(group, each, len(first)) for each in values])
    points, normals = sums[:, :2] / count[:, None], sums[:, 2:]
    normals = normals / np.maximum(np.hypot(*normals.T), 1e-9)[:, None]
    order = np.argsort(count, kind="stable")
    return SurfacePoints(points[order], normals[order], surface.is_flat[first][order])
