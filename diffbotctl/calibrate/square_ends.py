"""The ends of squares as they were measured, and mistakes of reading that they show.

A wrong sign or unit in all answers looks like another robot. So the squares end at different places
beside their starts: what is measured must differ as the odometry does.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan, sqrt
from statistics import fmean
from typing import NamedTuple

from diffbotctl.calibrate.dead_reckoning import EndError, wrap_angle
from diffbotctl.calibrate.umbmark import SquareErrors
from diffbotctl.errors import Problem, RunError

# Places at which the squares of one direction end, in turn: forward and left, of the side.
END_PLACES = ((0.04, 0.04), (-0.04, -0.04), (0.04, -0.04), (-0.04, 0.04), (0.0, 0.0))
# Of the change of the answers over that of odometry, which is 1 but for slip and reading.
FACTOR_ERROR_MIN, FACTOR_ERROR_SDS = 0.6, 4.0
FACTOR_ENDS_MIN = 4


class SquareEnd(NamedTuple):
    """Where one square ended, in the frame of its start; nan if not read."""

    measured: EndError
    odometry: EndError

    @property
    def error(self) -> EndError:
        measured, odometry = self
        heading = wrap_angle(measured.heading - odometry.heading)
        return EndError(measured.x - odometry.x, measured.y - odometry.y, heading)


def square_errors(
    side: float, clockwise: Sequence[SquareEnd], counter: Sequence[SquareEnd]
) -> SquareErrors:
    """The end errors. Raises RunError if the answers do not change from square to square as
    odometry does."""
    for words, axis in (("in front", 0), ("to the left", 1)):
        found = _factor([_along(ends, axis) for ends in (clockwise, counter)])
        if found is None:
            continue
        factor, sd = found
        if abs(factor - 1.0) <= max(FACTOR_ERROR_MIN, FACTOR_ERROR_SDS * sd):
            continue
        cause = (
            f"from square to square the answers {words} change by {factor:.2g} times what the "
            "wheels counted"
        )
        fix = (
            "answer in millimetres, or with a unit such as `3.5 cm`, from the start mark: in front "
            "and to the left positive, behind and right negative. Then run this step again"
        )
        raise RunError(Problem("E-CALIBRATE-ANSWER", "geometry", cause, fix))
    return SquareErrors(side, *([end.error for end in ends] for ends in (clockwise, counter)))


def end_place(number: int, side: float) -> tuple[float, float]:
    """Where square `number` (from 0) of a direction shall end, m forward and left of its start."""
    forward, left = END_PLACES[number % len(END_PLACES)]
    return forward * side, left * side


def _along(ends: Sequence[SquareEnd], axis: int) -> list[tuple[float, float]]:
    """The ends by odometry and as measured along an axis, less their means, m."""
    pairs = [(end.odometry[axis], end.measured[axis]) for end in ends]
    middle = [fmean(column) for column in zip(*pairs, strict=True)]
    return [(reckoned - middle[0], measured - middle[1]) for reckoned, measured in pairs]


def _factor(groups: Sequence[Sequence[tuple[float, float]]]) -> tuple[float, float] | None:
    """The change of the measured ends over that of odometry, and its standard deviation; None if
    there are too few ends, or not all were measured."""
    pairs = [pair for group in groups for pair in group]
    freedom = len(pairs) - len(groups) - 1
    size = sum(reckoned**2 for reckoned, _ in pairs)
    if len(pairs) < FACTOR_ENDS_MIN or any(isnan(measured) for _, measured in pairs) or not size:
        return None
    factor = sum(reckoned * measured for reckoned, measured in pairs) / size
    rest = sum((measured - factor * reckoned) ** 2 for reckoned, measured in pairs)
    return factor, sqrt(rest / freedom / size)
