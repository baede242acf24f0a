"""Faults of recorded counts that no fit can repair: jumps, gaps, parts of drives, dead encoders."""

from __future__ import annotations

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats

ROWS_MIN = 20  # of a drive; fewer show no usual step
JUMP_RATIO_MIN = 6.0  # of a step to the usual large ones, in counts and per s
JUMP_COUNTS_MIN = 20.0
COUNT_MAX = 2.0**53  # of a counter; larger ones are not exact numbers
GAP_TIME_RATIO_MIN = 4.0  # of the time between two rows to the usual long ones
GAP_COUNTS_MIN = 4.0
GAP_STEP_RATIO_MIN = 3.0
DEAD_RATIO_MAX = 0.02  # of the counts of the other wheel
DEAD_COUNTS_MIN = 20.0  # of the other wheel
COPIED_COUNTS_MIN = 100.0  # two wheels do not count so many at the same times
# A person measures where a robot stands. Wheels follow a command within 0.05 to 0.3 s, so that in
# the first rows of a whole drive they are slow, and in the last rows they become slower.
FIRST_S, LAST_S = 0.06, 0.1
FIRST_RATE_RATIO_MIN, LAST_RATE_RATIO_MIN = 0.8, 0.7  # of the mean rate of the counts
SLOWER_RATIO_MAX = 0.8  # of the last rate to that of the rows before
PART_COUNTS_MIN = 6.0  # fewer show no rate
PART_ROWS_MAX = 40  # whatever the unit of the times is
WHEELS = ("right", "left")


def table_fault(table: Floats) -> str | None:
    """Why `table` (rows, 3: time in s, counts of the right and left wheel) is no drive; None if it
    is one."""
    if len(table) < 2:
        return "needs at least two rows, increasing times, and a count in every row"
    bad = np.flatnonzero(~(np.abs(table) < COUNT_MAX).all(axis=1))
    if len(bad):
        return f"row {bad[0] + 1} has no time or no count, or one that no counter reaches"
    bad = np.flatnonzero(np.diff(table[:, 0]) <= 0)
    if len(bad):
        row = int(bad[0])
        return (
            f"needs increasing times, but row {row + 2} has {table[row + 1, 0]:g} after "
            f"{table[row, 0]:g}"
        )
    return None


def count_fault(times: Floats, counts: Floats) -> str | None:
    """What is wrong with the counts (rows, 2) of the right and left wheel; None if nothing is.

    `times` (rows,) in s.
    """
    if len(times) < ROWS_MIN:
        return None
    for wheel, column in zip(WHEELS, counts.T, strict=True):
        fault = _jump(wheel, times, column)
        if fault is not None:
            return fault
    return _gap(times, counts)


def _jump(wheel: str, times: Floats, column: Floats) -> str | None:
    size = np.abs(np.diff(column))
    if not size.any():
        return None
    rates = size / np.diff(times)
    usual, usual_rate = (float(np.percentile(each[size > 0], 90)) for each in (size, rates))
    is_jump = (size > JUMP_RATIO_MIN * usual + JUMP_COUNTS_MIN) & (
        rates > JUMP_RATIO_MIN * usual_rate
    )
    if not is_jump.any():
        return None
    row = int(np.argmax(np.where(is_jump, size, 0.0)))
    return (
        f"the counts of the {wheel} wheel jump by {column[row + 1] - column[row]:+.0f} at "
        f"{times[row + 1]:.2f} s: did the counter wrap around, or was it set back?"
    )


def _gap(times: Floats, counts: Floats) -> str | None:
    periods = np.diff(times)
    sizes = np.abs(np.diff(counts, axis=0)).max(axis=1)
    if not sizes.any():
        return None
    usual = float(np.percentile(sizes[sizes > 0], 90))
    is_gap = (periods > GAP_TIME_RATIO_MIN * float(np.percentile(periods, 90))) & (
        sizes > max(GAP_STEP_RATIO_MIN * usual, GAP_COUNTS_MIN)
    )
    if not is_gap.any():
        return None
    row = int(np.argmax(is_gap))
    return (
        f"there is a gap from {times[row]:.2f} s to {times[row + 1]:.2f} s in which the wheels "
        "turned along an unknown path"
    )


def part_fault(times: Floats, counts: Floats) -> str | None:
    """Which part of a drive whose end was measured at rest is missing; None if none is.

    `times` (rows,) in s, `counts` (rows, 2).
    """
    if len(times) < ROWS_MIN:
        return None
    sizes = np.abs(np.diff(counts, axis=0)).sum(axis=1)
    periods = np.diff(times)
    usual = float(sizes.sum() / periods.sum())
    rows = _row_count(periods, FIRST_S)
    counted, rate = _rate(sizes[:rows], periods[:rows])
    if counted >= PART_COUNTS_MIN and rate > FIRST_RATE_RATIO_MIN * usual:
        return "the wheels already turn in the first rows: is the beginning of the drive missing?"
    rows = _row_count(periods[::-1], max(LAST_S, PART_COUNTS_MIN / max(usual, 1e-9)))
    counted, rate = _rate(sizes[-rows:], periods[-rows:])
    _, before = _rate(sizes[-3 * rows : -rows], periods[-3 * rows : -rows])
    if counted >= PART_COUNTS_MIN and rate > max(
        LAST_RATE_RATIO_MIN * usual, SLOWER_RATIO_MAX * before
    ):
        return "the wheels still turn in the last rows: is the end of the drive missing?"
    return None


def _row_count(periods: Floats, span: float) -> int:
    """How many rows last `span` s; `periods` (rows,) in s."""
    rows = int(np.count_nonzero(np.cumsum(periods) <= span * (1 + 1e-6)))
    return min(max(rows, 1), PART_ROWS_MAX, len(periods) // 4)


def _rate(sizes: Floats, periods: Floats) -> tuple[float, float]:
    """The counts of both wheels in some rows, and per s."""
    return float(sizes.sum()), float(sizes.sum() / periods.sum())


def encoder_fault(counts: Floats) -> str | None:
    """Whether an encoder did not count, or both counted alike; `counts` (rows, 2) of the right and
    left wheel."""
    totals = np.abs(np.diff(counts, axis=0)).sum(axis=0)
    if not totals.any():
        return "neither encoder counted: leave out drives in which the robot stood"
    for wheel, total, other in zip(WHEELS, totals, totals[::-1], strict=True):
        if total <= DEAD_RATIO_MAX * other and other >= DEAD_COUNTS_MIN:
            return f"the {wheel} encoder counted {total:.0f}, the other one {other:.0f}"
    if totals[0] >= COPIED_COUNTS_MIN and (counts[:, 0] == counts[:, 1]).all():
        return "both wheels have the same counts in every row: was one column written twice?"
    return None
