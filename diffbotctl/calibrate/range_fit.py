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

RULER_DISTANCES_M = (0.04, 0.07, 0.10, 0.16, 0.25, 0.30)  # m; close where the curve bends most
POINTS_MIN = 4  # one more than there are numbers to find
NEAR_ERROR_MAX_M, FAR_FROM_M, FAR_ERROR_RATIO_MAX = 0.003, 0.20, 0.02  # m, m, share of the distance
RULER_SD_M = 0.0005  # m; sd of a distance held by hand at a ruler
SHIFT_MIN_M, SHIFT_MAX_M = 0.0, 0.05  # m; of b: what lies inside the case, as far as it can be
SHIFT_TOLERANCE_RATIO = 1e-6  # of the range of b, to which it is found
GOLDEN_RATIO = (sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True, slots=True)
class RulerPoint:
    """What the sensor said of an object at a known distance."""

    distance: float
    """m, from the sensor's front"""
    volts: float
    """mean of the readings"""
    noise: float
    """V; standard deviation of one reading"""
    readings: int

    @property
    def sd(self) -> float:
        """V; standard deviation of the mean."""
        return self.noise / sqrt(self.readings)


@dataclass(frozen=True, slots=True)
class RangeFit:
    """A sensor's curve, and how well it tells the points that it was found from."""

    a: float
    """V m"""
    b: float
    """m"""
    c: float
    """V"""
    sd: tuple[float, float, float]
    """of a, b and c, from the points' noise, the ruler's, and what the curve leaves over"""
    points: tuple[RulerPoint, ...]
    """by rising distance"""

    def told(self, point: RulerPoint) -> float:
        """The distance (m) that the curve tells at the point's voltage."""
        return distance_at(point.volts, self.a, self.b, self.c)

    def error(self, point: RulerPoint) -> float:
        """m; told minus true."""
        return self.told(point) - point.distance

    def misses(self) -> list[RulerPoint]:
        """Points that the curve tells worse than is asked."""
        return [each for each in self.points if abs(self.error(each)) > error_limit(each.distance)]

    @property
    def noise(self) -> float:
        """V; of one reading, over all points."""
        return sqrt(sum(each.noise**2 for each in self.points) / len(self.points))


def error_limit(distance: float) -> float:
    """How far a told distance may be from the true one, in m."""
    return NEAR_ERROR_MAX_M if distance <= FAR_FROM_M else FAR_ERROR_RATIO_MAX * distance


def fit_curve(points: Sequence[RulerPoint]) -> RangeFit:
    """The curve whose distances are nearest to the ruler's, by least squares.

    For a given b the other two are linear and follow at once; b is found by golden section.
    Raises ValueError with the reason when the points cannot be those of such a sensor.
    """
    ordered = tuple(sorted(points, key=lambda each: each.distance))
    _check_points(ordered)
    b = _golden_section(lambda shift: _solve_linear(ordered, shift)[2], SHIFT_MIN_M, SHIFT_MAX_M)
    a, c, left = _solve_linear(ordered, b)
    if not a > 0.0:
        raise ValueError("the voltages do not fall as a Sharp sensor's do: is it the right pin?")
    return RangeFit(a, b, c, _standard_deviations(ordered, a, b, left), ordered)


def _check_points(points: Sequence[RulerPoint]) -> None:
    """Raise ValueError when no curve can be laid through the points."""
    if len({each.distance for each in points}) < POINTS_MIN:
        raise ValueError(f"{len(points)} distances; {POINTS_MIN} different ones are needed")
    for near, far in pairwise(points):
        if far.distance == near.distance:
            continue
        if near.volts < far.volts:
            raise ValueError(_rising_cause(near, far))


def _rising_cause(near: RulerPoint, far: RulerPoint) -> str:
    seen = (
        f"{near.volts:.2f} V at {near.distance * 100:g} cm, "
        f"and more, {far.volts:.2f} V, at {far.distance * 100:g} cm"
    )
    if near.distance <= 0.05:
        return (
            f"{seen}: nearer than 3 cm the voltage folds back, so the object stood too near; "
            "measure from the sensor's front, not from the robot's"
        )
    return f"{seen}: it must fall with distance; was one of the two not where it was said to be?"


def _solve_linear(points: Sequence[RulerPoint], shift: float) -> tuple[float, float, float]:
    """a and c for a given b, and the mean square of the distances' errors against what is allowed.

    A voltage's error divided by the slope a / (d + b)^2 is the distance's.
    """
    distance = np.array([each.distance for each in points])
    volts = np.array([each.volts for each in points])
    weight = (distance + shift) ** 2 / np.array([error_limit(each) for each in distance])
    table = np.column_stack((1.0 / (distance + shift), np.ones_like(distance)))
    (a, c), *_ = np.linalg.lstsq(table * weight[:, None], volts * weight, rcond=None)
    errors = (volts - table @ (a, c)) * weight / a
    return float(a), float(c), float(np.mean(errors**2))


def _golden_section(cost: Callable[[float], float], low: float, high: float) -> float:
    """Where `cost`, a function with one valley, is least between `low` and `high`."""
    left, right = high - GOLDEN_RATIO * (high - low), low + GOLDEN_RATIO * (high - low)
    at_left, at_right = cost(left), cost(right)
    end = SHIFT_TOLERANCE_RATIO * (high - low)
    while high - low > end:
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - GOLDEN_RATIO * (high - low)
            at_left = cost(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + GOLDEN_RATIO * (high - low)
            at_right = cost(right)
    return 0.5 * (low + high)


def _standard_deviations(
    points: Sequence[RulerPoint], a: float, b: float, left: float
) -> tuple[float, float, float]:
    """Of a, b and c: the points' noise and the ruler's, or what the curve leaves over if more."""
    distance = np.array([each.distance for each in points]) + b
    slope = a / distance**2
    scale = np.array([error_limit(each.distance) for each in points])
    table = np.column_stack((1.0 / distance, -slope, np.ones_like(distance))) / slope[:, None]
    weighted = table / scale[:, None]
    inverse = np.linalg.pinv(weighted)
    known = (np.array([each.sd for each in points]) / slope) ** 2 + RULER_SD_M**2
    spare = max(len(points) - 3, 1)
    whole = np.maximum(known / scale**2, left * len(points) / spare)
    variances = (inverse**2) @ whole
    first, second, third = (float(each) for each in np.sqrt(variances))
    return first, second, third
