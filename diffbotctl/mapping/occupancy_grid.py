"""The map as cells that are free, occupied or unknown.

Each cell holds an integer log-odds of being occupied (Thrun, Burgard and Fox 2005, chapter 9). It
is limited on both sides, so that five looks clear what has been moved away.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diffbotctl.mapping.lidar_scan import MappedScan
from diffbotctl.mapping.plane_pose import Array, transformed

OCCUPIED, FREE = 0.65, 0.196  # thresholds of map_server
LOG_ODDS = 0.75  # of one unit
HIT, MISS = 3, -2
HIGHEST, LOWEST = 6, -9  # five misses turn the most certain wall into free space
PERCENT = np.rint(100 / (1 + np.exp(-LOG_ODDS * np.arange(LOWEST, HIGHEST + 1)))).astype(np.int8)
CLEARANCE = 0.2  # m before and behind its end, where a ray may touch the cells of what it meets
GROWTH = 40  # cells, by which the grid grows beyond what it must hold
CELLS_MAX = 16_000_000  # of one grid: 200 m x 200 m at 5 cm
RESOLUTION_MIN, RESOLUTION_MAX = 0.01, 1.0  # m


class OccupancyGrid(NamedTuple):
    """A picture of the map, row after row from the lowest y on."""

    resolution: float
    """m, of a cell"""
    origin: tuple[float, float]
    """x, y of the lower left corner of cell [0, 0] in map, m"""
    cells: NDArray[np.int8]
    """rows (y) x columns (x): -1 unknown, 0 free to 100 occupied"""

    @property
    def is_free(self) -> NDArray[np.bool_]:
        """Of each cell."""
        return (self.cells >= 0) & (self.cells <= 100 * FREE)

    @property
    def is_occupied(self) -> NDArray[np.bool_]:
        """Of each cell."""
        return self.cells >= 100 * OCCUPIED


class GridBuilder:
    """Log-odds of the cells that scans have crossed; grows with them."""

    def __init__(self, resolution: float) -> None:
        self.resolution = resolution
        self.low = np.zeros(2, np.int64)  # cell number of [0, 0]
        self.odds = np.zeros((0, 0), np.int8)  # rows: y
        self.seen = np.zeros((0, 0), np.bool_)

    @classmethod
    def of(cls, grid: OccupancyGrid) -> GridBuilder:
        """The log-odds of the cells of `grid`, whose origin is rounded to whole cells."""
        share = np.clip(np.arange(-1, 101), 1, 99) / 100  # by cell; the first is an unknown one
        odds = np.rint(np.log(share / (1 - share)) / LOG_ODDS).astype(np.int8)
        odds[0] = 0
        builder = cls(grid.resolution)
        builder.low = np.rint(np.array(grid.origin) / grid.resolution).astype(np.int64)
        builder.odds, builder.seen = odds[grid.cells + 1], grid.cells >= 0
        return builder

    def _hold(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> bool:
        """Grow so that the cells from `low` to `high` (x, y) fit; False when that is too many."""
        if self.odds.size:
            size = np.array(self.odds.shape[::-1])
            if (low >= self.low).all() and (high < self.low + size).all():
                return True
            low = np.where(low < self.low, low - GROWTH, self.low)
            high = np.where(high >= self.low + size, high + GROWTH, self.low + size - 1)
        columns, rows = (high - low + 1).tolist()
        if columns * rows > CELLS_MAX:
            return False
        odds = np.zeros((rows, columns), np.int8)
        seen = np.zeros((rows, columns), np.bool_)
        if self.odds.size:
            x, y = (self.low - low).tolist()
            part = slice(y, y + self.odds.shape[0]), slice(x, x + self.odds.shape[1])
            odds[part], seen[part] = self.odds, self.seen
        self.low, self.odds, self.seen = low, odds, seen
        return True

    def insert(self, scan: MappedScan, pose: Array) -> None:
        """Add the rays of `scan`, seen from `pose` (base_link in map)."""
        source = transformed(np.array([scan.origin]), pose)[0]
        ends = transformed(np.vstack([scan.points, scan.clear]), pose)
        if not len(ends):
            return
        low = np.floor(np.minimum(ends.min(0), source) / self.resolution).astype(np.int64)
        high = np.floor(np.maximum(ends.max(0), source) / self.resolution).astype(np.int64)
        if not self._hold(low, high):
            return
        # All within the part of the grid around this scan, which costs less than the whole one.
        corner = low - self.low
        columns, rows = (high - low + 1).tolist()
        part = (slice(corner[1], corner[1] + rows), slice(corner[0], corner[0] + columns))

        def cells(points: Array) -> NDArray[np.int64]:
            place = np.floor(points / self.resolution).astype(np.int64) - low
            return np.asarray(place[..., 1] * columns + place[..., 0])

        ray = ends - source
        length = np.hypot(*ray.T)
        along = self.resolution * np.arange(int(length.max() / self.resolution) + 1)
        before = along[None, :] < (length - self.resolution)[:, None]
        share = along[None, :] / np.maximum(length, 1e-9)[:, None]
        change = np.zeros(rows * columns, np.int8)
        change[cells((source + ray[:, None, :] * share[..., None])[before])] = MISS
        change[cells(ends[: len(scan.points)])] = HIT
        change = change.reshape(rows, columns)
        self.odds[part] = np.clip(self.odds[part] + change, LOWEST, HIGHEST)
        self.seen[part] |= change != 0

    def contradicted(self, scan: MappedScan, pose: Array) -> float:
        """Share of the rays of `scan`, from `pose`, through occupied cells or to free ones."""
        if not len(scan.points) or not self.odds.size:
            return 0.0
        source = transformed(np.array([scan.origin]), pose)[0]
        ray = transformed(scan.points, pose) - source
        length = np.hypot(*ray.T)
        counts = np.floor((length + CLEARANCE) / self.resolution).astype(np.int64) + 1  # of cells
        starts = np.cumsum(counts) - counts
        along = self.resolution * (np.arange(counts.sum()) - starts.repeat(counts))
        share = along / np.maximum(length, 1e-9).repeat(counts)
        place = np.floor((source + ray.repeat(counts, 0) * share[:, None]) / self.resolution)
        column, row = (place.astype(np.int64) - self.low).T
        rows, columns = self.odds.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        odds = inside * self.odds.reshape(-1)[np.where(inside, row * columns + column, 0)]
        before = along < (length - CLEARANCE).repeat(counts)
        passes = np.logical_or.reduceat((odds > 0) & before, starts)
        return float((passes | np.logical_and.reduceat((odds < 0) | before, starts)).mean())

    def grid(self) -> OccupancyGrid:
        """The grid with a probability for each cell: 50 where free and occupied balance."""
        cells = PERCENT[self.odds - LOWEST]
        cells[~self.seen] = -1
        x, y = (self.low * self.resolution).tolist()
        return OccupancyGrid(self.resolution, (x, y), cells)
