"""Probabilities of innovations, with a robust one for motions that change suddenly.

A wheel that meets an obstacle or a seam, or whose battery gives way, does not move as its motor
model predicts. Such a change is a second explanation of an innovation, with a normal distribution
as wide as the innovation itself (a maximum likelihood estimate of its variance).
"""

from __future__ import annotations

from math import erf, exp, log, pi, sqrt


def is_outlier(ratio: float, cost: float) -> bool:
    """Whether a sudden change of the motion explains an innovation better than its variance.

    `ratio`: of the square of the innovation to the variance. `cost`: minus the log probability of
    such a change.
    """
    return 0.5 * ratio > cost and ratio - log(1.0 + ratio) > 2.0 * cost + 1.0


def robust_log_likelihood(innovation: float, variance: float, cost: float) -> float:
    """Log density of `innovation`, which may also be caused by a sudden change of the motion."""
    ratio = innovation * innovation / variance
    if not is_outlier(ratio, cost):
        return -0.5 * (ratio + log(2.0 * pi * variance))
    return -0.5 - cost - 0.5 * log(2.0 * pi * variance * (1.0 + ratio))


def normal_density(square: float, variance: float) -> float:
    """Of a normal distribution at the root of `square`, times the root of 2 pi."""
    return exp(-0.5 * square / variance) / sqrt(variance)


def normal_cdf(value: float) -> float:
    """Cumulative distribution function of the standard normal distribution."""
    return 0.5 * (1.0 + erf(value * 0.7071067811865476))


def truncated_normal(below: float, above: float, mass: float) -> tuple[float, float]:
    """Mean and variance of a standard normal truncated to (below, above).

    `mass`: probability of that interval.
    """
    at_below = exp(-0.5 * below * below) / sqrt(2.0 * pi)
    at_above = exp(-0.5 * above * above) / sqrt(2.0 * pi)
    mean = (at_below - at_above) / mass
    variance = 1.0 + (below * at_below - above * at_above) / mass - mean * mean
    return mean, max(variance, 0.0)
