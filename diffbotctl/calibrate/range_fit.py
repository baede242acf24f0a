"""The curve of one distance sensor, volts = a / (distance + b) + c, through a few ruler points.

The three numbers differ from part to part (the data sheet allows 0.15 V either way), which moves a
wall at 20 cm by four centimetres. What counts is the error of the distance, not of the voltage: 10
mV are 0.2 mm at 4 cm and 6.6 mm at 30 cm. So the fit makes the distances' errors small, each
against what is asked of it there: 3 mm to 20 cm, 2 % beyond.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from diffbotctl.blocks.range_sensor import distance_at

Floats: TypeAlias = NDArray[np.float64]

RULER_DISTANCES_M = (0.04, 0.07, 0.10, 0.16, 0.25, 0.30)  # denser where the curve bends most
POINTS_MIN = 4  # one more than there are parameters
NEAR_ERROR_MAX_M, FAR_FROM_M, FAR_ERROR_RATIO_MAX = 0.003, 0.20, 0.02
RULER_SD_M = 0.0005  # of a card held at a ruler
SHIFT_MIN_M, SHIFT_MAX_M = 0.0, 0.05  # of b: what lies inside the case
SHIFT_TOLERANCE_RATIO = 1e-6  # of the range of b
FOLD_DISTANCE_M = 0.05  # a point up to here may have been measured in the fold of the curve
MISREAD_RATIO_MIN = 2.0  # of the limit: the error of a point by the curve of the others
CLEAR_RATIO = 2.0  # of the worst errors without the second and without the best candidate
GOLDEN_RATIO = (sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True, slots=True)
class RulerPoint:
    """Readings of the sensor with an object at a known distance."""

    distance: float  # m, from the sensor's front
    volts: float  # mean of the readings
    noise: float  # V; standard deviation of one reading
    readings: int

    @property
    def sd(self) -> float:
        """V; standard deviation of the mean."""
        return self.noise / sqrt(self.readings)


@dataclass(frozen=True, slots=True)
class RangeFit:
    """A sensor's curve, and how well it fits the points."""

    a: float  # V m
    b: float  # m
    c: float  # V
    sd: tuple[float, float, float]
    """of a, b and c, from the points' noise, the ruler's, and what the curve leaves over"""
    points: tuple[RulerPoint, ...]  # by rising distance

    def distance(self, point: RulerPoint) -> float:
        """The distance (m) of the curve at the point's voltage."""
        return distance_at(point.volts, self.a, self.b, self.c)

    def error(self, point: RulerPoint) -> float:
        """m; sensor minus ruler."""
        return self.distance(point) - point.distance

    def bad_points(self) -> list[RulerPoint]:
        """Points whose error exceeds the limit."""
        return [
            point for point in self.points if abs(self.error(point)) > error_limit(point.distance)
        ]

    @property
    def noise(self) -> float:
        """V; of one reading, over all points."""
        return sqrt(sum(point.noise**2 for point in self.points) / len(self.points))


def error_limit(distance: float) -> float:
    """The largest acceptable error of a distance, in m."""
    return NEAR_ERROR_MAX_M if distance <= FAR_FROM_M else FAR_ERROR_RATIO_MAX * distance


def fit_curve(points: Sequence[RulerPoint]) -> RangeFit:
    """The curve whose distances are nearest to those of the ruler, by least squares.

    For a given b the other two parameters are linear; b is found by golden-section search. Raises
    ValueError with the reason if such a sensor cannot have these points.
    """
    ordered = tuple(sorted(points, key=lambda point: point.distance))
    _check_points(ordered)
    b = _golden_section(lambda shift: _solve_linear(ordered, shift)[2], SHIFT_MIN_M, SHIFT_MAX_M)
    a, c, mean_square = _solve_linear(ordered, b)
    if not a > 0.0:
        raise ValueError(
            "the voltages do not fall with distance as those of a Sharp sensor: is it the right "
            "pin?"
        )
    return RangeFit(a, b, c, _standard_deviations(ordered, a, b, mean_square), ordered)


def find_misread(points: Sequence[RulerPoint]) -> tuple[RulerPoint, RangeFit] | None:
    """The point without which all others fit, and their curve; None if there is none, or several.

    A misread distance bends the whole curve, so its own error is not the largest one. What shows it
    is how far it lies from the curve of the others.
    """
    found = []
    for point in points:
        others = [other for other in points if other is not point]
        try:
            fit = fit_curve(others)
        except ValueError:
            continue
        error = abs(fit.distance(point) - point.distance)
        if not fit.bad_points() and error > MISREAD_RATIO_MIN * error_limit(point.distance):
            found.append((point, fit))
    if not found:
        return None
    ranked = sorted(found, key=lambda pair: _worst_ratio(pair[1]))
    if len(ranked) > 1 and _worst_ratio(ranked[1][1]) < CLEAR_RATIO * _worst_ratio(ranked[0][1]):
        return None
    return ranked[0]


def _worst_ratio(fit: RangeFit) -> float:
    """The largest error of a point over its limit."""
    return max(abs(fit.error(point)) / error_limit(point.distance) for point in fit.points)


def _check_points(points: Sequence[RulerPoint]) -> None:
    """Raises ValueError if no curve fits the points."""
    count = len({point.distance for point in points})
    if count < POINTS_MIN:
        raise ValueError(f"{POINTS_MIN} different distances are needed, and these are {count}")
    for near, far in pairwise(points):
        if far.distance == near.distance or near.volts >= far.volts:
            continue
        readings = (
            f"{near.volts:.2f} V at {near.distance * 100:g} cm, "
            f"but {far.volts:.2f} V at {far.distance * 100:g} cm"
        )
        if near.distance <= FOLD_DISTANCE_M:
            raise ValueError(
                f"{readings}: below 3 cm the voltage falls again, so the card was too near; "
                "measure from the front of the sensor, not of the robot"
            )
        raise ValueError(
            f"{readings}: it must fall with distance; was one of the two distances wrong?"
        )


def _solve_linear(points: Sequence[RulerPoint], b: float) -> tuple[float, float, float]:
    """a and c for a given b, and the mean square of the distance errors relative to their limits.

    The error of a distance is that of the voltage divided by the slope a / (d + b)^2.
    """
    distance = np.array([point.distance for point in points])
    volts = np.array([point.volts for point in points])
    limits = np.array([error_limit(point.distance) for point in points])
    weight = (distance + b) ** 2 / limits
    matrix = np.column_stack((1.0 / (distance + b), np.ones_like(distance)))
    (a, c), *_ = np.linalg.lstsq(matrix * weight[:, None], volts * weight, rcond=None)
    errors = (volts - matrix @ (a, c)) * weight / a
    return float(a), float(c), float(np.mean(errors**2))


def _golden_section(cost: Callable[[float], float], low: float, high: float) -> float:
    """The minimum of the unimodal function `cost` between `low` and `high`."""
    lower, upper = high - GOLDEN_RATIO * (high - low), low + GOLDEN_RATIO * (high - low)
    lower_cost, upper_cost = cost(lower), cost(upper)
    tolerance = SHIFT_TOLERANCE_RATIO * (high - low)
    while high - low > tolerance:
        if lower_cost < upper_cost:
            high, upper, upper_cost = upper, lower, lower_cost
            lower = high - GOLDEN_RATIO * (high - low)
            lower_cost = cost(lower)
        else:
            low, lower, lower_cost = lower, upper, upper_cost
            upper = low + GOLDEN_RATIO * (high - low)
            upper_cost = cost(upper)
    return 0.5 * (low + high)


def _standard_deviations(
    points: Sequence[RulerPoint], a: float, b: float, mean_square: float
) -> tuple[float, float, float]:
    """Of a, b and c, from the noise of points and ruler, or from the residuals if those are larger.

    `mean_square`: of the distance errors relative to their limits.
    """
    distance = np.array([point.distance for point in points]) + b
    slope = a / distance**2
    limits = np.array([error_limit(point.distance) for point in points])
    jacobian = np.column_stack((1.0 / distance, -slope, np.ones_like(distance))) / slope[:, None]
    inverse = np.linalg.pinv(jacobian / limits[:, None])
    expected = (np.array([point.sd for point in points]) / slope) ** 2 + RULER_SD_M**2
    freedom = max(len(points) - 3, 1)
    variances = np.maximum(expected / limits**2, mean_square * len(points) / freedom)
    sd_a, sd_b, sd_c = (float(sd) for sd in np.sqrt((inverse**2) @ variances))
    return sd_a, sd_b, sd_c
