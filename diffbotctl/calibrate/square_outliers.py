"""Squares whose end lies far from those of the others, which are left out.

A wheel that was held, a mark that was missed, or an edge that odometry gave to the wrong slot moves
one end by centimetres, and with it the track and the slip. Equal squares scatter by millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, log, sqrt
from statistics import median

from diffbotctl.calibrate.dead_reckoning import EndError
from diffbotctl.calibrate.umbmark import SquareErrors

SQUARES_MIN = 4  # of one direction; of three, two decide
OUTLIER_SDS = 6.0
POSITION_SD_MIN_M = 0.003  # of an end along an axis
MEDIAN_DISTANCE_SDS = sqrt(2 * log(2))  # of a normal distribution in the plane
MM = 1000.0


def without_outliers(squares: SquareErrors) -> tuple[SquareErrors, list[str]]:
    """The squares without outliers, and a line for each that was left out."""
    if not squares.has_positions:
        return squares, []
    lines: list[str] = []
    clockwise = _good_ends(squares.clockwise, "clockwise", lines)
    counter = _good_ends(squares.counter, "counter-clockwise", lines)
    return squares._replace(clockwise=clockwise, counter=counter), lines


def _good_ends(ends: Sequence[EndError], direction: str, lines: list[str]) -> list[EndError]:
    """The ends near their median; a line is added for each other one."""
    if len(ends) < SQUARES_MIN:
        return list(ends)
    x, y = median(end.x for end in ends), median(end.y for end in ends)
    distances = [hypot(end.x - x, end.y - y) for end in ends]
    sd = max(median(distances) / MEDIAN_DISTANCE_SDS, POSITION_SD_MIN_M)
    good = []
    for number, (end, distance) in enumerate(zip(ends, distances, strict=True), 1):
        if distance <= OUTLIER_SDS * sd:
            good.append(end)
            continue
        lines.append(
            f"square {number} {direction} left out: its end lies {distance * MM:.0f} mm from those "
            "of the others"
        )
    return good
