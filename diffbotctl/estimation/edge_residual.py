"""What hypotheses of a motor leave of the edges that its wheel counts, relative to those explained.

What a duty explains is uncertain: the dead band and the shape of the curve from duty to speed, the
load of the robot, which motors calibrated with raised wheels do not have, and the battery. What
they take of the edges depends on the duty. So the edges are compared in classes of duties: a motor
that explains all of them at once is likelier than one that does so in each of them by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, log, sqrt
from typing import NamedTuple

from diffbotctl.estimation.explained_edges import EdgeRatio
from diffbotctl.estimation.lost_edges import LEVEL_SD, SHIFT_PRIORS, SHIFTS

# Error of the typical curve from duty to speed, in edges that friction takes, with probabilities:
# 0 is a linear motor with its dead band. Motors that are quick to coast between two pulses take
# several times the speed of it at small duties.
CURVES = ((0.0, 0.3), (0.5, 0.15), (1.0, 0.15), (2.0, 0.15), (4.0, 0.15), (8.0, 0.1))
# The same of a curve that was measured: whether the windings are open between pulses is known.
MEASURED_CURVES = (0.0, 0.8), (0.5, 0.2)
# Duty that moving the robot takes of both motors, which are calibrated with raised wheels, and its
# probability.
LOADS = ((0.0, 0.4), (0.07, 0.2), (0.14, 0.15), (0.21, 0.15), (0.3, 0.1))
COMMON_LOAD_SD = 0.15  # relative; what one of the wheels has to move
SHARE_MIN = 0.1  # of the edges explained, left by friction and load; less is not told apart
# Standard deviations of the logarithm of a ratio: of a calibrated motor; by its own friction,
# relative to that of both, and to the error of the curve; of its lag.
GAIN_SD, FRICTION_SD, CURVE_SD, LAG_SD = 0.07, 0.4, 0.2, 0.2
# The same of one class of duties; edges, of the cut at both ends of the time.
CLASS_SD, ROUNDING_SD = 0.04, 0.6
# The same where the times of the edges, which the loop of the board had, are not known.
MIRROR_SD = 0.45
# A load that one of the wheels has of its own: its probability, and the standard deviation of the
# logarithm of the ratio by it.
LOAD_PROBABILITY, LOAD_SD = 0.1, 0.35
CLASS_EDGES_MIN = 3.0  # explained; a class with less shows nothing


class MotorHypothesis(NamedTuple):
    """Error of the curve, load of both motors (a duty), and the probability of the pair."""

    curve: float
    load: float
    probability: float


def _hypotheses(curves: Sequence[tuple[float, float]]) -> tuple[MotorHypothesis, ...]:
    return tuple(
        MotorHypothesis(curve, load, of_curve * of_load)
        for curve, of_curve in curves
        for load, of_load in LOADS
    )


MOTORS, MEASURED_MOTORS = _hypotheses(CURVES), _hypotheses(MEASURED_CURVES)


class EdgeLogRatio(NamedTuple):
    """Logarithm of the edges counted over those explained, and what it depends on."""

    value: float
    friction: float
    """edges that friction takes, relative to those explained"""
    load: float
    """edges that a load of all of the duty takes, relative to those explained"""
    variance: float
    """without that of friction, curve and gain"""

    @classmethod
    def of(cls, edges: EdgeRatio) -> EdgeLogRatio:
        """The ratio of sums of edges."""
        explained, counted = edges.explained, max(edges.counted, 1.0)
        lag, rounding = LAG_SD * edges.transient / explained, ROUNDING_SD / counted
        mirror = MIRROR_SD * edges.untimed / explained
        return cls(
            log(counted / explained),
            edges.friction / explained,
            edges.load / explained,
            CLASS_SD * CLASS_SD + lag * lag + rounding * rounding + mirror * mirror,
        )


class Residual(NamedTuple):
    """What the ratios of a wheel show beyond one hypothesis of its motor."""

    value: float
    """mean of the logarithms that are left"""
    variance: float
    """of it, with the gain of the motor known"""
    likelihood: float
    """of the differences between the classes"""

    def moved(self, shift: float, variance: float = 0.0) -> Residual:
        """With `shift` added to its mean, and `variance` to the variance."""
        return Residual(self.value + shift, self.variance + variance, self.likelihood)


def of_classes(ratios: Sequence[EdgeRatio]) -> list[EdgeLogRatio]:
    """Those that explain enough edges."""
    return [EdgeLogRatio.of(edges) for edges in ratios if edges.explained > CLASS_EDGES_MIN]


def residual(
    ratios: Sequence[EdgeLogRatio], curve: float, load: float, class_sd: float = 0.0
) -> Residual:
    """What a curve and a load leave of the ratios; `class_sd`: an error that each may have."""
    weight = mean = square = 0.0
    product = 1.0
    for ratio in ratios:
        share = max(1.0 + curve * ratio.friction - load * ratio.load, SHARE_MIN)
        own = (FRICTION_SD + CURVE_SD * curve) * ratio.friction / share
        uneven = COMMON_LOAD_SD * load * ratio.load / share
        variance = ratio.variance + own * own + uneven * uneven + class_sd * class_sd
        value = ratio.value - log(share)
        weight += 1.0 / variance
        mean += value / variance
        square += value * value / variance
        product *= variance
    scatter = square - mean * mean / weight
    likelihood = exp(-0.5 * scatter) / sqrt(product * weight)
    return Residual(mean / weight, 1.0 / weight, likelihood)


def density(left: Residual, right: Residual, level_sd: float = LEVEL_SD) -> float:
    """Of two residuals, with a level in common: that of the battery."""
    level = level_sd * level_sd
    x, y, xx, yy = left.value, right.value, left.variance + level, right.variance + level
    determinant = xx * yy - level * level
    square = yy * x * x - 2.0 * level * x * y + xx * y * y
    classes = left.likelihood * right.likelihood
    return classes * exp(-0.5 * square / determinant) / sqrt(determinant)


def loaded_likelihood(left: Residual, right: Residual, level_sd: float = LEVEL_SD) -> float:
    """Of working encoders and a load on one of the wheels, with its probability."""
    variance = LOAD_SD * LOAD_SD
    on_left = density(left.moved(0.0, variance), right, level_sd)
    on_right = density(left, right.moved(0.0, variance), level_sd)
    return 0.5 * LOAD_PROBABILITY * (on_left + on_right)


def fault_likelihoods(
    left: Residual, right: Residual, is_even: bool, level_sd: float = LEVEL_SD
) -> list[float]:
    """Of each of SHIFTS, with its probability. `is_even`: none of one encoder alone."""
    return [
        prior * density(left.moved(left_shift), right.moved(right_shift), level_sd)
        if not is_even or left_shift == right_shift
        else 0.0
        for prior, (left_shift, right_shift) in zip(SHIFT_PRIORS, SHIFTS, strict=True)
    ]
