"""UMBmark: wheel ratio and track from squares driven both ways round.

Source: Borenstein & Feng, "Measurement and correction of systematic odometry errors in mobile
robots", IEEE Trans. Robotics and Automation 12(6), 1996, 869-880; headings after Jung & Chung,
Int. J. Advanced Robotic Systems 8(6), 2011. Frame: the start pose, first side along +x, x forward,
y left, heading counter-clockwise. An error is the true value minus that of odometry.

Two angles describe it: alpha is the missing part of a quarter turn (rad, positive if the true track
is larger than the one in use), beta is the heading change along a side (rad, positive if the right
wheel is larger than in use). To first order they move the end of a square with side L by
    clockwise          (-2 L alpha - 2 L beta, -2 L alpha - 2 L beta)
    counter-clockwise  (-2 L alpha + 2 L beta, +2 L alpha - 2 L beta)
so only both directions together separate them. The position and the heading rule are combined with
the inverse of their variances.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import copysign, cos, hypot, isnan, nan, pi, sin, sqrt
from statistics import stdev
from typing import NamedTuple

from diffbotctl.calibrate.confidence import STUDENT_T_95_LIMIT, student_t
from diffbotctl.calibrate.dead_reckoning import EndError, Geometry

SQUARE_SIDES = 4
POSITION_SD_MIN_M = 0.001  # of a tape
HEADING_SD_MIN_RAD = 0.005  # of a set square
ITERATIONS = 6  # each reduces the error to a tenth or less
CONTRADICTION_SDS_MIN = 5.0  # of the means, of their residuals
CONTRADICTION_RATIO_MIN = 0.02  # of the side: residual means that no geometry explains
SIDE_TRACK_RATIO_MAX = 8.0  # above, the errors are not small enough for the equations
SIDE_MAX_M = 1.0
QUARTER_TURN = pi / 2  # rad; one turn on the spot


class Angles(NamedTuple):
    """What the squares came to, rad."""

    alpha: float
    """missed by each quarter turn"""
    beta: float
    """gained along each side, to the left"""


def mean_end(ends: Sequence[EndError]) -> EndError:
    """Centre of gravity of one direction's ends. Raises ValueError when there are none."""
    if not ends:
        raise ValueError("UMBmark needs at least one run in each direction")
    count = len(ends)
    return EndError(*(sum(column) / count for column in zip(*ends, strict=True)))


def systematic_error(clockwise: Sequence[EndError], counter: Sequence[EndError]) -> float:
    """E_max,syst in m: the further of the two centres of gravity from no error at all."""
    return max(hypot(end.x, end.y) for end in (mean_end(clockwise), mean_end(counter)))


def angles_from_positions(side: float, clockwise: EndError, counter: EndError) -> Angles:
    """Angles from where two mean ends lie; `side` in m.

    The x and the y equations are averaged: their second-order errors have opposite signs.
    """
    along, across = (
        _angles_from_x(side, clockwise, counter),
        _angles_from_y(side, clockwise, counter),
    )
    return Angles((along.alpha + across.alpha) / 2, (along.beta + across.beta) / 2)


def angles_from_headings(side: float, clockwise: EndError, counter: EndError) -> Angles:
    """Angles from how two mean ends are turned; better than positions when sides are long."""
    return Angles(
        (clockwise.heading - counter.heading) / (2 * SQUARE_SIDES),
        (clockwise.heading + counter.heading) / (2 * SQUARE_SIDES),
    )


def correct_geometry(geometry: Geometry, side: float, angles: Angles) -> Geometry:
    """The geometry with which the square would have closed; the mean diameter is kept.

    `geometry` is what odometry used during the runs. The ratio found multiplies the one in use: a
    second round that began again from equal wheels would undo the first. Raises ValueError when the
    angles are beyond what a square can show.
    """
    # The side is the chord of an arc with radius r: half of it is r sin(beta / 2). The wheels run
    # at r + b/2 and r - b/2; both are multiplied by sin(beta / 2) here, since r may be infinite.
    chord, half = side / 2, geometry.track / 2 * sin(angles.beta / 2)
    if angles.alpha >= QUARTER_TURN or abs(half) >= chord:
        raise ValueError("these end points are too far off for squares of that size")
    track_ratio = QUARTER_TURN / (QUARTER_TURN - angles.alpha)
    wheel_ratio = (chord + half) / (chord - half)
    return geometry.reshaped(geometry.ratio * wheel_ratio, geometry.track * track_ratio)


def square_end(side: float, used: Geometry, true: Geometry, clockwise: bool) -> EndError:
    """Exact end error of a square that odometry with `used` geometry thinks it drove perfectly.

    Every side is a true arc, every turn a true turn about a point near the middle; `side` in m.
    """
    right, left = true.right / used.right, true.left / used.left
    turn = copysign(QUARTER_TURN * used.track / 2, -1 if clockwise else 1)
    x = y = heading = 0.0
    for _ in range(SQUARE_SIDES):
        for right_way, left_way in ((side * right, side * left), (turn * right, -turn * left)):
            turned = (right_way - left_way) / true.track
            chord = (right_way + left_way) / 2 * _chord_over_arc(turned)
            x += chord * cos(heading + turned / 2)
            y += chord * sin(heading + turned / 2)
            heading += turned
    return EndError(x, y, heading - copysign(2 * pi, turn))


def _chord_over_arc(turned: float) -> float:
    return sin(turned / 2) / (turned / 2) if turned else 1.0


def _angles_from_x(side: float, clockwise: EndError, counter: EndError) -> Angles:
    scale = -4 * side
    return Angles((clockwise.x + counter.x) / scale, (clockwise.x - counter.x) / scale)


def _angles_from_y(side: float, clockwise: EndError, counter: EndError) -> Angles:
    scale = -4 * side
    return Angles((clockwise.y - counter.y) / scale, (clockwise.y + counter.y) / scale)


Rule = Callable[[float, EndError, EndError], Angles]
"""From the side and the mean ends, clockwise and counter-clockwise, to the angles"""


class SquareErrors(NamedTuple):
    """End errors of both directions; headings are nan if not read."""

    side: float
    """m"""
    clockwise: Sequence[EndError]
    counter: Sequence[EndError]

    @property
    def has_headings(self) -> bool:
        """Whether every end was read with its heading."""
        return not any(isnan(end.heading) for end in (*self.clockwise, *self.counter))

    @property
    def has_positions(self) -> bool:
        """Whether every end was read with its place."""
        return not any(isnan(end.x) for end in (*self.clockwise, *self.counter))


class UmbmarkResult(NamedTuple):
    """What the squares came to."""

    geometry: Geometry
    angles: Angles
    sd: Angles
    """standard deviations of the angles, rad"""
    before: float
    """E_max,syst, m; nan without places"""
    after: float
    """the same, as predicted with the new geometry"""


def advised_side(track: float) -> float:
    """Side in m: the longer the more shows, but no longer than the equations hold."""
    return min(SIDE_MAX_M, SIDE_TRACK_RATIO_MAX * track)


def fit_umbmark(squares: SquareErrors, used: Geometry, weight: float = 1.0) -> UmbmarkResult:
    """The geometry with which these squares would have closed; odometry had `used`.

    `weight` scales the correction: 1 for a first round; 1/2 if `used` is the result of as many
    squares, so that the outcome is the mean of both rounds. Raises ValueError if the ends are too
    far off, or neither positions nor headings were measured.
    """
    estimates = []
    if squares.has_positions:
        angles = _solve_angles(squares, used, angles_from_positions)
        sd = max(_position_sd(squares), _misfit_sd(squares, used, angles))
        estimates.append((angles, 1.0 / sd**2))
    if squares.has_headings:
        angles = _solve_angles(squares, used, angles_from_headings)
        estimates.append((angles, 1.0 / _heading_sd(squares) ** 2))
    if not estimates:
        raise ValueError("neither places nor headings were read of every square")
    total = sum(inverse_variance for _, inverse_variance in estimates)
    alpha, beta = (
        weight * (sum(inverse * angles[index] for angles, inverse in estimates) / total)
        for index in (0, 1)
    )
    # A spread from few squares is itself uncertain.
    freedom = len(squares.clockwise) + len(squares.counter) - 2
    sd = sqrt(weight / total) * student_t(freedom) / STUDENT_T_95_LIMIT
    geometry = correct_geometry(used, squares.side, Angles(alpha, beta))
    before = after = nan
    if squares.has_positions:
        before = systematic_error(squares.clockwise, squares.counter)
        after = max(hypot(end.x, end.y) for end in _residual_ends(squares, used, geometry))
    return UmbmarkResult(geometry, Angles(alpha, beta), Angles(sd, sd), before, after)


def ends_contradict(squares: SquareErrors, result: UmbmarkResult) -> bool:
    """Whether no geometry explains the centres of both directions."""
    if not squares.has_positions:
        return False
    ways = (squares.clockwise, squares.counter)
    noise = max(_position_spread(ends) / sqrt(len(ends)) for ends in ways)
    return result.after > max(CONTRADICTION_SDS_MIN * noise, CONTRADICTION_RATIO_MIN * squares.side)


def _solve_angles(squares: SquareErrors, used: Geometry, rule: Rule) -> Angles:
    """The angles with which the squares would end exactly there.

    A rule is of first order. Applied again to the residual ends of the present solution, it
    converges to the exact solution, as further rounds on the floor would.
    """
    angles, geometry = Angles(0.0, 0.0), used
    for _ in range(ITERATIONS):
        step = rule(squares.side, *_residual_ends(squares, used, geometry))
        angles = Angles(angles.alpha + step.alpha, angles.beta + step.beta)
        geometry = correct_geometry(used, squares.side, angles)
    return angles


def _residual_ends(
    squares: SquareErrors, used: Geometry, true: Geometry
) -> tuple[EndError, EndError]:
    """Mean ends, clockwise and counter-clockwise, minus those that `true` geometry explains."""
    residuals = []
    for ends, clockwise in ((squares.clockwise, True), (squares.counter, False)):
        predicted = square_end(squares.side, used, true, clockwise)
        pairs = zip(mean_end(ends), predicted, strict=True)
        residuals.append(EndError(*(measured - explained for measured, explained in pairs)))
    return residuals[0], residuals[1]


def _position_sd(squares: SquareErrors) -> float:
    # Each angle is the mean of two rules, each the sum of two means over four sides: so it depends
    # on x + y of clockwise ends and x - y of the others. Corners that turn too far move both
    # coordinates, which makes the scatter along these diagonals larger than along the axes.
    scatter = sum(
        max(_position_spread(ends), _diagonal_spread(ends, sign)) ** 2 / len(ends)
        for ends, sign in ((squares.clockwise, 1.0), (squares.counter, -1.0))
    )
    return sqrt(scatter) / (SQUARE_SIDES * squares.side * sqrt(2.0))


def _misfit_sd(squares: SquareErrors, used: Geometry, angles: Angles) -> float:
    """Standard deviation of the angles by the residual centres: four coordinates, two angles."""
    geometry = correct_geometry(used, squares.side, angles)
    residuals = _residual_ends(squares, used, geometry)
    square_sum = sum(end.x**2 + end.y**2 for end in residuals)
    return sqrt(square_sum / 2) / (SQUARE_SIDES * squares.side)


def _heading_sd(squares: SquareErrors) -> float:
    scatter = 0.0
    for ends in (squares.clockwise, squares.counter):
        spread = stdev(end.heading for end in ends) if len(ends) > 1 else HEADING_SD_MIN_RAD
        scatter += max(spread, HEADING_SD_MIN_RAD) ** 2 / len(ends)
    return sqrt(scatter) / (2 * SQUARE_SIDES)


def _diagonal_spread(ends: Sequence[EndError], sign: float) -> float:
    """Standard deviation of an end along (1, `sign`), m; 0 of fewer than two ends."""
    return stdev(end.x + sign * end.y for end in ends) / sqrt(2.0) if len(ends) > 1 else 0.0


def _position_spread(ends: Sequence[EndError]) -> float:
    """Standard deviation of an end along an axis, m."""
    if len(ends) < 2:
        return POSITION_SD_MIN_M
    along, across = stdev(end.x for end in ends), stdev(end.y for end in ends)
    return max(sqrt((along**2 + across**2) / 2), POSITION_SD_MIN_M)
