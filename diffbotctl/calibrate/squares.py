"""From ten squares' end errors to a geometry: both rules of UMBmark, weighed by their scatter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, isnan, nan, sqrt
from statistics import stdev
from typing import NamedTuple

from diffbotctl.calibrate import umbmark
from diffbotctl.calibrate.geometry import Geometry
from diffbotctl.calibrate.umbmark import SIDES, Angles, EndError

LEAST_SPREAD = 0.001  # m: what a tape can tell
LEAST_HEADING = 0.005  # rad: what a set square can tell
REFINEMENTS = 6  # each leaves a tenth of what the one before has left, or less
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


def fit(squares: Squares, used: Geometry, share: float = 1.0) -> Found:
    """The geometry that would have driven these squares right; `used` is what odometry took.

    `share` of what they say is believed: all of it by itself; a half when `used` comes from as many
    squares already, so that the outcome is the mean of both. Raises ValueError when they are too
    far off, or nothing was read.
    """
    rules = []
    if squares.has_positions:
        rules.append((_solved(squares, used, _by_positions), _position_sd(squares)))
    if squares.has_headings:
        rules.append((_solved(squares, used, _by_headings), _heading_sd(squares)))
    if not rules:
        raise ValueError("neither places nor headings were read of every square")
    weights = [1.0 / sd**2 for _, sd in rules]
    alpha, beta = (
        sum(weight * angles[which] for weight, (angles, _) in zip(weights, rules, strict=True))
        / sum(weights)
        for which in (0, 1)
    )
    alpha, beta = share * alpha, share * beta
    sd = sqrt(share / sum(weights))
    found = umbmark.corrected(used, squares.side, Angles(alpha, beta))
    before = after = nan
    if squares.has_positions:
        before = umbmark.systematic_error(squares.clockwise, squares.counter)
        after = max(hypot(end.x, end.y) for end in _unexplained(squares, used, found))
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


Rule = Callable[[float, EndError, EndError], Angles]


def _solved(squares: Squares, used: Geometry, rule: Rule) -> Angles:
    """The angles by which squares would end exactly there.

    A rule is of first order; applied again to what the geometry found so far does not explain, it
    converges on the exact solution, as a second round on the floor would.
    """
    angles, found = Angles(0.0, 0.0), used
    for _ in range(REFINEMENTS):
        more = rule(squares.side, *_unexplained(squares, used, found))
        angles = Angles(angles.alpha + more.alpha, angles.beta + more.beta)
        found = umbmark.corrected(used, squares.side, angles)
    return angles


def _unexplained(squares: Squares, used: Geometry, found: Geometry) -> tuple[EndError, EndError]:
    """What is left of the mean ends, clockwise and counter, if `found` is the true geometry."""
    rest = []
    for ends, clockwise in ((squares.clockwise, True), (squares.counter, False)):
        middle = umbmark.mean(ends)
        explained = umbmark.square_end(squares.side, used, found, clockwise)
        rest.append(EndError(*(a - b for a, b in zip(middle, explained, strict=True))))
    return rest[0], rest[1]


def _by_positions(side: float, clockwise: EndError, counter: EndError) -> Angles:
    return umbmark.from_positions(side, clockwise, counter)


def _by_headings(side: float, clockwise: EndError, counter: EndError) -> Angles:
    return umbmark.from_headings(clockwise, counter)


def _position_sd(squares: Squares) -> float:
    scatter = sum(_spread(ends) ** 2 / len(ends) for ends in (squares.clockwise, squares.counter))
    # Each angle is the mean of two rules, each the sum of two means over four sides.
    return sqrt(scatter) / (SIDES * squares.side * sqrt(2.0))


def _heading_sd(squares: Squares) -> float:
    scatter = 0.0
    for ends in (squares.clockwise, squares.counter):
        spread = stdev(end.heading for end in ends) if len(ends) > 1 else LEAST_HEADING
        scatter += max(spread, LEAST_HEADING) ** 2 / len(ends)
    return sqrt(scatter) / (2 * SIDES)


def _spread(ends: Sequence[EndError]) -> float:
    """Standard deviation of an end along an axis, m."""
    if len(ends) < 2:
        return LEAST_SPREAD
    along, across = stdev(end.x for end in ends), stdev(end.y for end in ends)
    return max(sqrt((along**2 + across**2) / 2), LEAST_SPREAD)
