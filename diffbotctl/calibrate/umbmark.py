"""UMBmark: wheel ratio, track and slip from squares driven both ways round.

Source of the procedure: Borenstein & Feng, "Measurement and correction of systematic odometry
errors in mobile robots", IEEE Trans. Robotics and Automation 12(6), 1996, 869-880. Frame: the start
pose, first side along +x, x forward, y left, heading counter-clockwise. An error is the true value
minus that of odometry.

Two angles describe it: alpha is the missing part of a quarter turn (rad, positive if the true track
is larger than the one in use), beta is the heading change along a side (rad, positive if the right
wheel is larger than in use). To first order they move the end of a square with side L by
    clockwise          (-2 L alpha - 2 L beta, -2 L alpha - 2 L beta)
    counter-clockwise  (-2 L alpha + 2 L beta, +2 L alpha - 2 L beta)
so only both directions together separate them. Instead of these equations the posterior of the
geometry is computed (geometry_posterior.py), for the wheels of a square that odometry closes.

Squares of one direction differ by the slip of the wheels, whose covariance at the end is known but
for one factor, and by how their ends are read, which is known roughly: slip of 0.5 mm after a metre
already moves the end of a square of 1 m by twice as much.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import asin, copysign, hypot, isnan, log, pi, sin, sqrt
from statistics import stdev
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import EndError, Geometry, Segment, dead_reckon
from diffbotctl.calibrate.end_noise import HEADING, POSITION, START, NoiseGrid, NoisePrior
from diffbotctl.calibrate.geometry_posterior import (
    RATIO_SD,
    TRACK_SD,
    GeometryPrior,
    WrongEnds,
    posterior,
    solve,
)

SQUARE_SIDES = 4
SIDE_STEPS, TURN_STEPS = 20, 8  # into which a side and a turn are divided
POSITION_SD_MIN_M = 0.001  # of a tape
CONTRADICTION_SDS_MIN = 5.0  # of the means, of their residuals
CONTRADICTION_RATIO_MIN = 0.02  # of the side: residual means that no geometry explains
SIDE_TRACK_RATIO_MAX = 8.0  # of longer sides the track is known no better
SIDE_MAX_M = 1.0
QUARTER_TURN = pi / 2  # rad; one turn on the spot
GOOD_RATIO_MIN = 0.6  # of the squares whose ends agree
MM = 1000.0
MEAN_SD = 1e-6  # relative: squares do not change the mean diameter
# Before the squares: floors and tyres of small robots have 0.5 to 2 mm after a metre.
SLIP = NoisePrior(0.001, 2.5, tuple(np.exp(np.linspace(log(0.0001), log(0.1), 110)).tolist()))
NOISE = NoiseGrid.of(
    SLIP, *(NoisePrior(each.typical, 2.0, (each.typical,)) for each in (POSITION, HEADING, START))
)
# An edge that odometry gives to the wrong slot turns the rest of a square: of a disc with 20 slots
# by 0.08 rad, which moves the end by up to 0.12 of a side, 0.03 of the way.
WRONG = WrongEnds(0.02, 0.03)
# Of 15 simulated robots with ten squares the logarithms of the slip had errors of 0.34, and the
# scatter states 0.19: odometry does not end each square alike.
SLIP_MODEL_SD_RATIO = 0.3


class Angles(NamedTuple):
    """What the squares came to, rad."""

    alpha: float  # missed by each quarter turn
    beta: float  # gained along each side, to the left


def mean_end(ends: Sequence[EndError]) -> EndError:
    """Centre of gravity of one direction's ends. Raises ValueError when there are none."""
    if not ends:
        raise ValueError("UMBmark needs at least one run in each direction")
    return EndError(*(sum(column) / len(ends) for column in zip(*ends, strict=True)))


def systematic_error(clockwise: Sequence[EndError], counter: Sequence[EndError]) -> float:
    """E_max,syst in m: the further of the two centres of gravity from no error at all."""
    return max(hypot(end.x, end.y) for end in (mean_end(clockwise), mean_end(counter)))


def correct_geometry(geometry: Geometry, side: float, angles: Angles) -> Geometry:
    """The geometry with which the square would have closed; the mean diameter is kept.

    `geometry` is what odometry used during the runs. Raises ValueError when the angles are beyond
    what a square can show.
    """
    # The side is the chord of an arc with radius r: half of it is r sin(beta / 2). The wheels run
    # at r + b/2 and r - b/2; both are multiplied by sin(beta / 2) here, since r may be infinite.
    chord, half = side / 2, geometry.track / 2 * sin(angles.beta / 2)
    if angles.alpha >= QUARTER_TURN or abs(half) >= chord:
        raise ValueError("these end points are too far off for squares of that size")
    track_ratio = QUARTER_TURN / (QUARTER_TURN - angles.alpha)
    wheel_ratio = (chord + half) / (chord - half)
    return geometry.reshaped(geometry.ratio * wheel_ratio, geometry.track * track_ratio)


def angles_between(used: Geometry, true: Geometry, side: float) -> Angles:
    """The angles of a robot with `true` geometry that drives with the `used` one."""
    ratio = true.ratio / used.ratio
    beta = 2 * asin(side / used.track * (ratio - 1) / (ratio + 1))
    return Angles(QUARTER_TURN * (1 - used.track / true.track), beta)


class SquareErrors(NamedTuple):
    """End errors of both directions; headings or places are nan if not read."""

    side: float  # m
    clockwise: Sequence[EndError]
    counter: Sequence[EndError]

    @property
    def has_positions(self) -> bool:
        """Whether every end was read with its place."""
        return not any(isnan(end.x) for end in (*self.clockwise, *self.counter))


class DrivenSquare(NamedTuple):
    """A square with `side` (m) that odometry with the `used` geometry closes."""

    name: str
    side: float
    used: Geometry
    is_clockwise: bool
    error: EndError

    @property
    def segment(self) -> Segment:
        """The way of its wheels, and its measured end."""
        turn = copysign(QUARTER_TURN * self.used.track / 2, -1 if self.is_clockwise else 1)
        steps = [
            *[(self.side / SIDE_STEPS, self.side / SIDE_STEPS)] * SIDE_STEPS,
            *[(turn / TURN_STEPS, -turn / TURN_STEPS)] * TURN_STEPS,
        ] * SQUARE_SIDES
        rolled = np.array(steps) / (self.used.right, self.used.left)
        closed = np.array([0.0, 0.0, copysign(2 * pi, turn)])
        return Segment(rolled, closed + self.error, (0.0, 0.0))

    def residual(self, geometry: Geometry) -> EndError:
        """The part of its error that `geometry` does not explain."""
        segment = self.segment
        x, y, heading = map(float, segment.motion - dead_reckon(segment, geometry).end)
        return EndError(x, y, heading)


class SquaresFit(NamedTuple):
    """What the squares came to."""

    geometry: Geometry
    ratio_sd: float  # relative standard deviation of the wheel ratio
    track_sd: float  # likewise of the track, in multiples of the mean diameter
    slip: float  # m; standard deviation of a wheel's slip after one metre
    slip_sd: float | None
    """None if one square in each direction, or headings alone, do not show the slip"""
    left_out: Sequence[str]  # a line for each square whose end lies far from those of the others
    before: float  # E_max,syst (m) of the last round; nan without places
    after: float  # the same, as predicted with the new geometry
    is_contradicting: bool  # whether no geometry explains the centres of both directions


def advised_side(track: float) -> float:
    """Side in m: the longer the more shows, up to a limit."""
    return min(SIDE_MAX_M, SIDE_TRACK_RATIO_MAX * track)


def fit_squares(rounds: Sequence[tuple[Geometry, SquareErrors]]) -> SquaresFit:
    """The geometry and the slip that explain the squares of all rounds, each with the geometry that
    odometry used then.

    Raises ValueError if the ends are too far off, or a direction has none.
    """
    driven = [square for used, squares in rounds for square in _driven(used, squares)]
    segments, weights = [square.segment for square in driven], np.ones(len(driven))
    used, last = rounds[-1]
    before = systematic_error(last.clockwise, last.counter)
    prior = GeometryPrior(used, (MEAN_SD, RATIO_SD, TRACK_SD))
    rough = solve(segments, weights, used, prior, NOISE, WRONG)
    is_good = rough.good >= 0.5
    if is_good.mean() < GOOD_RATIO_MIN:
        raise ValueError("no track and no wheels explain the ends of both directions")
    kept = [segment for segment, good in zip(segments, is_good, strict=True) if good]
    found = posterior(kept, weights[is_good], rough.geometry, prior, NOISE)
    geometry = found.geometry
    ways = [
        [
            square.residual(geometry)
            for square, good in zip(driven, is_good, strict=True)
            if good and square.is_clockwise == is_clockwise
        ]
        for is_clockwise in (True, False)
    ]
    # What no geometry explains is common to all squares: four coordinates, two angles.
    centres = [mean_end(ends) for ends in ways]
    misfit = sqrt(sum(end.x**2 + end.y**2 for end in centres) / 2) / (SQUARE_SIDES * last.side)
    misfit = 0.0 if isnan(misfit) else misfit
    _, ratio_sd, track_sd = map(float, np.sqrt(np.diag(found.covariance)))
    slip = float(found.noise.slip[0])
    variance = float(found.share @ (NOISE.slip - slip) ** 2)
    has_scatter = last.has_positions and max(map(len, ways)) > 1
    after = systematic_error(*ways)
    return SquaresFit(
        geometry,
        max(ratio_sd, geometry.track / last.side * misfit),
        max(track_sd, misfit / QUARTER_TURN),
        slip,
        sqrt(variance + (SLIP_MODEL_SD_RATIO * slip) ** 2) if has_scatter else None,
        [
            f"{square.name} left out: its end lies "
            f"{hypot(*square.residual(geometry)[:2]) * MM:.0f} mm from those of the others"
            for square, good in zip(driven, is_good, strict=True)
            if not good
        ],
        before,
        after,
        last.has_positions and after > _unexplained_max(ways, last.side),
    )


def _driven(used: Geometry, squares: SquareErrors) -> Iterator[DrivenSquare]:
    ways = (("clockwise", squares.clockwise), ("counter-clockwise", squares.counter))
    for direction, ends in ways:
        for number, end in enumerate(ends, 1):
            name = f"square {number} {direction}"
            yield DrivenSquare(name, squares.side, used, direction == "clockwise", end)


def _unexplained_max(ways: Sequence[Sequence[EndError]], side: float) -> float:
    """The largest E_max,syst (m) that the scatter of the ends may leave."""
    noise = max(_spread(ends) / sqrt(len(ends)) for ends in ways)
    return max(CONTRADICTION_SDS_MIN * noise, CONTRADICTION_RATIO_MIN * side)


def _spread(ends: Sequence[EndError]) -> float:
    """Standard deviation of an end along an axis, m."""
    if len(ends) < 2:
        return POSITION_SD_MIN_M
    along, across = stdev(end.x for end in ends), stdev(end.y for end in ends)
    return max(sqrt((along**2 + across**2) / 2), POSITION_SD_MIN_M)
