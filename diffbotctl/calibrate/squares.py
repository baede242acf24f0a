"""From ten squares' end errors to a geometry: both rules of UMBmark, weighed by their scatter."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isnan, nan, sqrt
from statistics import stdev
from typing import NamedTuple

from diffbotctl.calibrate import umbmark
from diffbotctl.calibrate.geometry import Geometry
from diffbotctl.calibrate.umbmark import SIDES, Angles, EndError

LEAST_SPREAD = 0.001  # m: what a tape can tell
LEAST_HEADING = 0.005  # rad: what a set square can tell
SIGNIFICANT = 5.0  # standard deviations of the means, from which on swapped directions are named
LARGEST = 8.0  # side over track, beyond which the errors are no longer small (sensing, UMBmark)


class Squares(NamedTuple):
    """End errors of both directions; headings are nan where nobody read them."""

    side: float
    """m"""
    clockwise: Sequence[EndError]
    counter: Sequence[EndError]

    def exchanged(self) -> Squares:
        """The same with the directions taken for each other."""
        return Squares(self.side, self.counter, self.clockwise)

    @property
    def has_headings(self) -> bool:
        """Whether every end was read with its heading."""
        return not any(isnan(end.heading) for end in (*self.clockwise, *self.counter))

    @property
    def has_positions(self) -> bool:
        """Whether every end was read with its place."""
        return not any(isnan(end.x) for end in (*self.clockwise, *self.counter))


class Found(NamedTuple):
    """What the squares came to."""

    geometry: Geometry
    angles: Angles
    sd: Angles
    """standard deviations of the angles, rad"""
    before: float
    """E_max,syst, m; nan without places"""
    after: float
    """the same, as predicted with the new geometry"""


def advised_side(track: float, longest: float = 1.0) -> float:
    """Side in m: the longer the more shows, but no longer than the equations hold."""
    return min(longest, LARGEST * track)


def fit(squares: Squares, used: Geometry) -> Found:
    """The geometry that would have driven these squares right; `used` is what odometry took.

    Raises ValueError when they are too far off, or nothing was read.
    """
    rules = []
    if squares.has_positions:
        rules.append(_by_positions(squares))
    if squares.has_headings:
        rules.append(_by_headings(squares))
    if not rules:
        raise ValueError("neither places nor headings were read of every square")
    weights = [1.0 / sd**2 for _, sd in rules]
    alpha, beta = (
        sum(weight * angles[which] for weight, (angles, _) in zip(weights, rules, strict=True))
        / sum(weights)
        for which in (0, 1)
    )
    sd = 1.0 / sqrt(sum(weights))
    found = umbmark.corrected(used, squares.side, Angles(alpha, beta))
    before = after = nan
    if squares.has_positions:
        before = umbmark.systematic_error(squares.clockwise, squares.counter)
        after = _predicted(squares, used, found)
    return Found(found, Angles(alpha, beta), Angles(sd, sd), before, after)


def look_swapped(squares: Squares) -> bool:
    """Whether the directions were probably taken for each other, and that is no accident."""
    if not squares.has_positions:
        return False
    ways = (squares.clockwise, squares.counter)
    size = umbmark.systematic_error(*ways)
    noise = max(_spread(ends) / sqrt(len(ends)) for ends in ways)
    means = [umbmark.mean(ends) for ends in ways]
    return size > SIGNIFICANT * noise and umbmark.look_swapped(squares.side, *means)


def _by_positions(squares: Squares) -> tuple[Angles, float]:
    means = [umbmark.mean(ends) for ends in (squares.clockwise, squares.counter)]
    scatter = sum(_spread(ends) ** 2 / len(ends) for ends in (squares.clockwise, squares.counter))
    # Each angle is the mean of two rules, each the sum of two means over four sides.
    sd = sqrt(scatter) / (SIDES * squares.side * sqrt(2.0))
    return umbmark.from_positions(squares.side, *means), sd


def _by_headings(squares: Squares) -> tuple[Angles, float]:
    means = [umbmark.mean(ends) for ends in (squares.clockwise, squares.counter)]
    scatter = 0.0
    for ends in (squares.clockwise, squares.counter):
        spread = stdev(end.heading for end in ends) if len(ends) > 1 else LEAST_HEADING
        scatter += max(spread, LEAST_HEADING) ** 2 / len(ends)
    return umbmark.from_headings(*means), sqrt(scatter) / (2 * SIDES)


def _spread(ends: Sequence[EndError]) -> float:
    """Standard deviation of an end along an axis, m."""
    if len(ends) < 2:
        return LEAST_SPREAD
    along, across = stdev(end.x for end in ends), stdev(end.y for end in ends)
    return max(sqrt((along**2 + across**2) / 2), LEAST_SPREAD)


def _predicted(squares: Squares, used: Geometry, found: Geometry) -> float:
    """E_max,syst that is left when what the new geometry explains is taken away."""
    rest = []
    for ends, clockwise in ((squares.clockwise, True), (squares.counter, False)):
        middle = umbmark.mean(ends)
        explained = umbmark.square_end(squares.side, used, found, clockwise)
        rest.append(hypot(middle.x - explained.x, middle.y - explained.y))
    return max(rest)
