"""The pose from which points fit a map best, within a large window, without missing a better one.

Hess et al. 2016, "Real-time loop closure in 2D LIDAR SLAM", section V: cells of a coarse raster
bound the score of all poses within them. The work is done in steps of bounded size.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diffbotctl.mapping.match_field import CELL, FULL, LEVELS, PAD, MatchField
from diffbotctl.mapping.plane_pose import Array, rotated, wrapped

TURN_STEP = 0.0175  # rad
BATCH = 1024  # candidates that are divided at once
STEP_LOOKUPS = 500_000  # of the raster, in one step: about 10 ms
ARRAY_LOOKUPS = 50_000  # at once: 2 MB of indices
APART = (0.6, 0.3)  # m and rad; a pose nearer to another one belongs to the same peak
Index = NDArray[np.int64]


class Peak(NamedTuple):
    """A pose and its score, 0 to 1."""

    score: float
    pose: Array


class Window(NamedTuple):
    """The poses among which to search."""

    middle: Array
    """x, y, heading"""
    reach: float
    """m, along both axes"""
    turn: float
    """rad"""


class _Candidates(NamedTuple):
    """Squares of 2**level cells and one heading, the best bound first."""

    level: int
    turn: Index
    row: Index
    column: Index
    bound: Index

    def part(self, which: slice | NDArray[np.bool_]) -> _Candidates:
        return _Candidates(self.level, *(each[which] for each in self[1:]))


class _Search:
    """The cells of the points at each heading, and the bounds of candidates."""

    def __init__(self, field: MatchField, points: Array, window: Window) -> None:
        self.field, self.window = field, window
        count = int(np.ceil(min(window.turn, np.pi) / TURN_STEP))
        self.turns = TURN_STEP * np.arange(-count, count + 1)
        middle = window.middle
        seen = np.stack([rotated(points, float(middle[2]) + turn) for turn in self.turns])
        cell = np.floor((seen + middle[:2] - field.low) / CELL).astype(np.int64) + PAD
        self.rows, self.columns = cell[..., 0], cell[..., 1]
        self.count = len(points)

    def first(self) -> _Candidates:
        """All squares of the coarsest raster, not bounded yet."""
        size = 2**LEVELS
        count = int(np.ceil(self.window.reach / CELL / size))
        axis = size * np.arange(-count, count)
        grid = np.meshgrid(np.arange(len(self.turns)), axis, axis, indexing="ij")
        turn, row, column = (each.reshape(-1).astype(np.int64) for each in grid)
        return _Candidates(LEVELS, turn, row, column, np.zeros(len(turn), np.int64))

    def bounds(self, each: _Candidates) -> Index:
        size = max(1, ARRAY_LOOKUPS // max(1, self.count))
        starts = range(0, len(each.turn), size)
        bounds = [self._bounds(each.part(slice(start, start + size))) for start in starts]
        return np.concatenate([np.zeros(0, np.int64), *bounds])

    def _bounds(self, each: _Candidates) -> Index:
        raster = self.field.pyramid[each.level]
        row = self.rows[each.turn] + each.row[:, None]
        column = self.columns[each.turn] + each.column[:, None]
        height, width = raster.shape
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        index = np.where(inside, row * width + column, 0)
        total: Index = raster.reshape(-1)[index].sum(1, dtype=np.int64)
        return total

    def poses(self, each: _Candidates) -> Array:
        middle = self.window.middle
        return np.column_stack(
            [
                middle[0] + CELL * each.row,
                middle[1] + CELL * each.column,
                wrapped(middle[2] + self.turns[each.turn]),
            ]
        )


def best_pose(
    field: MatchField, points: Array, window: Window, least: float, excluded: Sequence[Array] = ()
) -> Generator[None, None, Peak | None]:
    """The pose with the highest score above `least` (0 to 1); none without one.

    `points`: N x 2 in the frame of the pose. `excluded`: poses around which not to look.
    """
    search = _Search(field, points, window)
    best, found = int(least * FULL * len(points)), None
    waiting: list[_Candidates] = []
    everything = search.first()
    chunk = max(1, STEP_LOOKUPS // max(1, len(points)))
    for start in range(0, len(everything.turn), chunk):
        part = everything.part(slice(start, start + chunk))
        part = part._replace(bound=search.bounds(part))
        waiting.append(part.part(part.bound > best))
        yield
    waiting = [_sorted(_merged(waiting))]
    lookups = 0
    while waiting:
        top = waiting.pop()
        top = top.part(top.bound > best)
        if not len(top.turn):
            continue
        if top.level == 0:
            poses = search.poses(top)
            fit = np.flatnonzero(~_near(poses, excluded))
            if len(fit):
                best = int(top.bound[fit[0]])
                found = Peak(best / (FULL * len(points)), poses[fit[0]])
            continue
        waiting.append(top.part(slice(BATCH, None)))
        children = _divided(top.part(slice(BATCH)))
        children = children._replace(bound=search.bounds(children))
        waiting.append(_sorted(children.part(children.bound > best)))
        lookups += len(children.turn) * len(points)
        if lookups > STEP_LOOKUPS:
            lookups = 0
            yield
    return found


def _merged(parts: list[_Candidates]) -> _Candidates:
    columns = [np.concatenate([part[i] for part in parts]) for i in range(1, 5)]
    return _Candidates(parts[0].level, *columns)


def _sorted(candidates: _Candidates) -> _Candidates:
    order = np.argsort(-candidates.bound, kind="stable")
    return _Candidates(candidates.level, *(each[order] for each in candidates[1:]))


def _divided(parents: _Candidates) -> _Candidates:
    half = 2 ** (parents.level - 1)
    row = (parents.row[:, None] + [0, 0, half, half]).reshape(-1)
    column = (parents.column[:, None] + [0, half, 0, half]).reshape(-1)
    turn, bound = np.repeat(parents.turn, 4), np.repeat(parents.bound, 4)
    return _Candidates(parents.level - 1, turn, row, column, bound)


def _near(poses: Array, others: Sequence[Array]) -> NDArray[np.bool_]:
    near = np.zeros(len(poses), bool)
    for other in others:
        apart = np.hypot(poses[:, 0] - other[0], poses[:, 1] - other[1])
        near |= (apart < APART[0]) & (np.abs(wrapped(poses[:, 2] - other[2])) < APART[1])
    return near
