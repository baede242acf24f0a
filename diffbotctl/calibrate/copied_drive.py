"""Whether two files of recorded counts hold the same drive, of which one may lack some rows.

Two drives of the same path differ in every row: the wheels never turn twice at the same times. A
copy has the same rows, but its clock and its counters may begin elsewhere, and rows may be missing
at its ends or between.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.dead_reckoning import Floats

TIME_UNITS, COUNT_UNITS = 1e3, 1e3  # ms: a difference of two times depends on their clock
ANCHORS = 8  # rows of one drive that are looked for in the other one
NEAR_ROWS, NEAR_MISSED_MAX = 6, 1  # next to an anchor, and those of them that need not be in both
# A few rows that both drives count alike by accident are no copy.
COPIED_ROWS_MIN, COPIED_COUNTS_MIN = 30, 40.0
COPIED_RATIO_MIN = 1 / 3  # of the rows of the shorter drive in which a wheel turned
EQUAL_RATIO_MIN = 0.98  # of the rows within the time that both share
OFFSETS_MAX = 20  # that are tried for each anchor
PERIODS_MIN = 8  # of a drive that is the same a little later
PERIOD_ROWS_MAX = 200
PERIODIC_RATIO_MIN = 0.5  # of its rows
HASH_FACTORS = np.array([0x9E3779B97F4A7C1, 0x2545F4914F6CDD1D, 0x5851F42D4C957F2D])
Rows = NDArray[np.int64]
"""(rows, 3): time in ms, and counts of both wheels in thousandths"""


def copied_ratio(one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> float:
    """The share of the rows of the shorter drive that the other one contains too; 0 if they are no
    copies of one drive.

    Each: times (rows,) in s, and counts (rows, 2).
    """
    rows, other_rows = _rows(*one), _rows(*other)
    moving, other_moving = _moving(rows), _moving(other_rows)
    short = min(moving, other_moving, key=len)
    if len(short) < COPIED_ROWS_MIN:
        return 0.0
    ratio = max(_contained(moving, other_rows), _contained(other_moving, rows)) / len(short)
    return min(ratio, 1.0) if ratio >= COPIED_RATIO_MIN and not _is_periodic(short) else 0.0


def _rows(times: Floats, counts: Floats) -> Rows:
    table = np.column_stack([times * TIME_UNITS, counts * COUNT_UNITS])
    return np.asarray(table.round().astype(np.int64))


def _moving(rows: Rows) -> Rows:
    """The rows in which a wheel turned."""
    return np.asarray(rows[1:][(np.diff(rows[:, 1:], axis=0) != 0).any(axis=1)])


def _contained(one: Rows, other: Rows) -> int:
    """How many rows of `one` are rows of `other` after a common offset; 0 if there is none by which
    nearly all are within the time that they share."""
    known, most = _known(other), 0
    for anchor in np.linspace(0, len(one) - NEAR_ROWS, ANCHORS).astype(int):
        for offset in _offsets(one[anchor : anchor + NEAR_ROWS], other, known):
            moved = one + offset
            inside = moved[(moved[:, 0] >= other[0, 0]) & (moved[:, 0] <= other[-1, 0])]
            equal = int(_is_in(_keys(inside), known).sum())
            way = np.abs(np.diff(inside[:, 1:], axis=0)).sum(axis=0).max(initial=0) / COUNT_UNITS
            if equal >= EQUAL_RATIO_MIN * len(inside) and way >= COPIED_COUNTS_MIN:
                most = max(most, equal)
    return most


def _offsets(near: Rows, other: Rows, known: NDArray[np.int64]) -> Rows:
    """The offsets by which most of the `near` rows are rows of `other` too."""
    offsets = other - near[0]
    missed = np.zeros(len(offsets), int)
    for row in near[1:]:
        missed += ~_is_in(_keys(row + offsets), known)
        offsets, missed = offsets[missed <= NEAR_MISSED_MAX], missed[missed <= NEAR_MISSED_MAX]
    return np.asarray(offsets[:OFFSETS_MAX])


def _is_periodic(rows: Rows) -> bool:
    """Whether the drive is nearly the same a little later, as at constant speeds: then another
    drive may be so too."""
    known, middle = _known(rows), len(rows) // 2
    for shift in range(1, min(len(rows) // PERIODS_MIN, PERIOD_ROWS_MAX) + 1):
        moved = rows[:-shift] + (rows[middle + shift] - rows[middle])
        if _is_in(_keys(moved), known).mean() > PERIODIC_RATIO_MIN:
            return True
    return False


def _keys(rows: Rows) -> NDArray[np.int64]:
    """A number for each row; those of different rows are equal once in 10^18."""
    return np.asarray(rows @ HASH_FACTORS)


def _known(rows: Rows) -> NDArray[np.int64]:
    """The keys of rows, sorted. Times that were rounded from other clocks differ by up to 1 ms."""
    keys = _keys(rows)
    return np.sort(np.concatenate([keys - HASH_FACTORS[0], keys, keys + HASH_FACTORS[0]]))


def _is_in(keys: NDArray[np.int64], known: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether each of the keys is one of `known`, which are sorted."""
    places = np.minimum(np.searchsorted(known, keys), len(known) - 1)
    return np.asarray(known[places] == keys)
