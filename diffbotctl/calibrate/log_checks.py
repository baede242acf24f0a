"""Faults of recorded counts that no fit can repair: wraps, jumps, gaps, dead encoders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats

ROWS_MIN = 20  # of a drive; fewer show no usual step
JUMP_RATIO_MIN = 8.0  # of a step to the usual large ones
JUMP_COUNTS_MIN = 20.0
WRAP_BITS = (8, 10, 12, 14, 15, 16, 24, 31, 32)
WRAP_TOLERANCE_RATIO = 0.2  # of the size of a wrap, for the motion in the same row, at most
WRAP_TOLERANCE_STEPS = 3.0  # usual ones, the same
WRAP_TOLERANCE_COUNTS = 3.0
COUNT_MAX = 2.0**53  # of a counter; larger ones are not exact numbers
SAME_TIMES_RATIO_MIN = 0.6  # of the rows; rows that are written twice are fewer
GROUPED_DIGITS = 1000.0
GAP_TIME_RATIO_MIN = 4.0  # of the time between two rows to the usual long ones
GAP_COUNTS_MIN = 4.0
GAP_STEP_RATIO_MIN = 3.0
TICKS_GAP_TIME_RATIO_MIN = 1.8  # one row of ticks is missing
DEAD_RATIO_MAX = 0.02  # of the counts of the other wheel
DEAD_COUNTS_MIN = 20.0  # of the other wheel
COPIED_COUNTS_MIN = 100.0  # in all drives; two wheels do not count so many at the same times
# A person measures where a robot stands. Wheels follow a command within 0.05 to 0.3 s, so that in
# the first rows of a whole drive they are slow, and in the last rows they become slower.
FIRST_S, LAST_S = 0.06, 0.1
FIRST_RATE_RATIO_MIN, LAST_RATE_RATIO_MIN = 0.8, 0.7  # of the mean rate of the counts
SLOWER_RATIO_MAX = 0.8  # of the last rate to that of the rows before
PART_COUNTS_MIN = 6.0  # fewer tell no rate
PART_ROWS_MAX = 40  # whatever the unit of the times is
WHEELS = ("right", "left")


def table_fault(table: Floats) -> str | None:
    """Why `table` (rows, 3: time in s, counts of the right and left wheel) is no drive; None if it
    is one."""
    if len(table) < 2:
        return "needs at least two rows, increasing times, and a count in every row"
    bad = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(bad):
        is_last = bad[0] == len(table) - 1
        cut = ", and is the last one: was the file cut off?" if is_last else ""
        return f"row {bad[0] + 1} has no time or no count, or one that is no finite number{cut}"
    bad = np.flatnonzero((np.abs(table[:, 1:]) > COUNT_MAX).any(axis=1))
    if len(bad):
        return f"row {bad[0] + 1} has a count that no counter reaches"
    steps = np.diff(table[:, 0])
    if (steps > 0).all():
        return None
    if (steps < 0).all():
        return "the times decrease: write the rows in the order in which they were measured"
    is_same = steps == 0
    if len(table) >= ROWS_MIN and float(np.mean(is_same)) > SAME_TIMES_RATIO_MIN:
        return (
            "needs increasing times, but most rows have the time of the row before: write times "
            "with more decimals"
        )
    row = int(np.argmin(steps > 0))
    is_twice = not steps[row] and (table[row] == table[row + 1]).all()
    return (
        f"needs increasing times, but row {row + 2} has {table[row + 1, 0]:g} after "
        f"{table[row, 0]:g}: "
        + ("is the row written twice?" if is_twice else "do the rows come from two drives?")
    )


def count_fault(times: Floats, counts: Floats) -> str | None:
    """What is wrong with the counts (rows, 2) of the right and left wheel; None if nothing is.

    `times` (rows,) in s.
    """
    if len(times) < ROWS_MIN:
        return None
    for wheel, column in zip(WHEELS, counts.T, strict=True):
        fault = _jump(wheel, times, column)
        if fault is not None:
            return _grouped_digits(wheel, column) or fault
    return _gap(times, counts)


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


def ticks_gap(times: Floats) -> str | None:
    """Where rows of ticks are missing; None if nowhere. The motion in them is lost."""
    steps = np.diff(times)
    worst = int(np.argmax(steps))
    if len(times) < ROWS_MIN or steps[worst] < TICKS_GAP_TIME_RATIO_MIN * float(np.median(steps)):
        return None
    return f"rows are missing: there is none from {times[worst]:.2f} s to {times[worst + 1]:.2f} s"


def standing_drive(turned: Floats) -> tuple[int, str] | None:
    """The first drive in which no wheel turned, and a text; `turned` (drives, 2): counts."""
    is_standing = ~turned.any(axis=1)
    if not is_standing.any():
        return None
    others = "any drive" if is_standing.all() else "this drive"
    return int(np.argmax(is_standing)), (
        f"neither encoder counted in {others}: leave out drives in which the robot stood, and run "
        "`diffbotctl calibrate encoders` if it moved"
    )


def dead_encoder(turned: Floats) -> str | None:
    """Which encoder did not count; `turned` (drives, 2): counts of the right and left wheel."""
    totals = turned.sum(axis=0)
    for wheel, total, other in zip(WHEELS, totals, totals[::-1], strict=True):
        if total <= DEAD_RATIO_MAX * other and other >= DEAD_COUNTS_MIN:
            return (
                f"the {wheel} encoder counted {total:.0f} in all drives, the other one "
                f"{other:.0f}: run `diffbotctl calibrate encoders`"
            )
    return None


def copied_column(counts: Sequence[Floats]) -> str | None:
    """Whether both columns of all drives hold the same counts; each (rows, 2)."""
    size = sum(float(np.abs(np.diff(each[:, 0])).sum()) for each in counts)
    if size < COPIED_COUNTS_MIN or any((each[:, 0] != each[:, 1]).any() for each in counts):
        return None
    return (
        "the counts of the right and the left wheel are the same in every row of every drive: was "
        "one column written twice?"
    )


def _jump(wheel: str, times: Floats, column: Floats) -> str | None:
    steps = np.diff(column)
    size, span = np.abs(steps), float(np.ptp(column))
    moving = size[size > 0]
    if not len(moving):
        return None
    usual = float(np.percentile(moving, 90))
    tolerance = WRAP_TOLERANCE_STEPS * usual + WRAP_TOLERANCE_COUNTS
    for bits in WRAP_BITS:
        limit = 2.0**bits
        is_wrap = size.max() > max(0.5 * limit, limit - tolerance)
        if 0.85 * limit <= span < limit and is_wrap:
            return _wrap_text(wheel, times, int(np.argmax(size)), f"{limit:.0f}")
    rates = size / np.maximum(np.diff(times), 1e-9)
    usual_rate = float(np.percentile(rates[size > 0], 90))
    is_jump = (size > JUMP_RATIO_MIN * usual + JUMP_COUNTS_MIN) & (
        rates > JUMP_RATIO_MIN * usual_rate
    )
    if not is_jump.any():
        return None
    worst = int(np.argmax(np.where(is_jump, size, 0.0)))
    for bits in WRAP_BITS:
        limit = 2.0**bits
        if abs(size[worst] - limit) < min(WRAP_TOLERANCE_RATIO * limit, tolerance):
            return _wrap_text(wheel, times, worst, f"{limit:.0f}")
    if worst == len(steps) - 1:
        return (
            f"the count of the {wheel} wheel in the last row differs by {steps[worst]:+.0f} from "
            "the row before: was the file cut off in this row?"
        )
    return (
        f"the counts of the {wheel} wheel jump by {steps[worst]:+.0f} at {times[worst + 1]:.2f} s: "
        "was the counter set back, or do rows come from another drive?"
    )


def _grouped_digits(wheel: str, column: Floats) -> str | None:
    """A text if points between thousands were read as decimal points: 999 is followed by 1.000."""
    is_whole = column == np.round(column)
    parts = column[~is_whole]
    thousandths = GROUPED_DIGITS * parts
    if (
        not len(parts)
        or not is_whole.any()
        or (np.abs(thousandths - thousandths.round()) > 1e-6).any()
    ):
        return None
    return (
        f"the counts of the {wheel} wheel have three decimals or none: write no points between "
        "thousands"
    )


def _wrap_text(wheel: str, times: Floats, row: int, limit: str) -> str:
    return (
        f"the counts of the {wheel} wheel wrap around at {limit}, first at {times[row + 1]:.2f} s: "
        "write counts that continue"
    )


def _gap(times: Floats, counts: Floats) -> str | None:
    periods = np.diff(times)
    sizes = np.abs(np.diff(counts, axis=0)).max(axis=1)
    moving = sizes[sizes > 0]
    if not len(moving):
        return None
    usual = float(np.percentile(moving, 90))
    is_gap = (periods > GAP_TIME_RATIO_MIN * float(np.percentile(periods, 90))) & (
        sizes > max(GAP_STEP_RATIO_MIN * usual, GAP_COUNTS_MIN)
    )
    if not is_gap.any():
        return None
    row = int(np.argmax(np.where(is_gap, sizes, 0.0)))
    return (
        f"there is a gap from {times[row]:.2f} s to {times[row + 1]:.2f} s in which the wheels "
        "turned: along which path is not recorded"
    )
