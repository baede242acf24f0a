"""The surfaces of an occupancy grid, for maps that come from elsewhere and have no scans."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from diffbotctl.mapping.lidar_scan import SurfacePoints
from diffbotctl.mapping.occupancy_grid import OccupancyGrid

NEAR = 3  # cells around one, whose line gives the direction of the surface
FLAT_COUNT_MIN = 4  # cells of a line
FLAT_RATIO_MAX = 0.15  # of the spreads across and along the line; an L has 0.27


def grid_surface(grid: OccupancyGrid) -> SurfacePoints:
    """The middles of occupied cells beside a free one, and the directions of the lines there.

    The inside of a filled wall is left out: no lidar sees it.
    """
    free = np.pad(grid.is_free, 1)
    beside = free[2:, 1:-1] | free[:-2, 1:-1] | free[1:-1, 2:] | free[1:-1, :-2]
    edge = beside & grid.is_occupied
    cells = np.argwhere(edge)
    x, y = grid.origin
    points = np.asarray((cells[:, ::-1] + 0.5) * grid.resolution + (x, y), float)
    moments = np.zeros((5, len(cells)))  # sums of x, y, xx, xy, yy of the neighbours
    count = np.zeros(len(cells))
    padded = np.pad(edge, NEAR)
    for row in range(-NEAR, NEAR + 1):
        for column in range(-NEAR, NEAR + 1):
            present = padded[cells[:, 0] + NEAR + row, cells[:, 1] + NEAR + column]
            count += present
            values = (column, row, column * column, column * row, row * row)
            moments += np.array(values)[:, None] * present
    mx, my, mxx, mxy, myy = moments / np.maximum(count, 1)
    xx, xy, yy = mxx - mx * mx, mxy - mx * my, myy - my * my
    middle, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    is_flat = (count >= FLAT_COUNT_MIN) & (middle - half < FLAT_RATIO_MAX * (middle + half))
    along = 0.5 * np.arctan2(2 * xy, xx - yy)
    normals = np.c_[-np.sin(along), np.cos(along)] * is_flat[:, None]
    return SurfacePoints(points, normals, is_flat)


def free_corners(grid: OccupancyGrid) -> NDArray[np.float64]:
    """2 x 2: lowest and highest x and y of the free cells, or of all where none is free."""
    is_free = grid.is_free
    if not is_free.any():
        is_free[:] = True
    spans = [np.flatnonzero(is_free.any(axis))[[0, -1]] for axis in (0, 1)]
    return np.asarray((np.array(spans).T + 0.5) * grid.resolution + grid.origin)
