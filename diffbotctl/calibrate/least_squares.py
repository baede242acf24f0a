"""Robust weighted least squares of the geometry over segments of recorded drives.

The unknowns are the natural logarithms of mean diameter, wheel ratio and track: for a robot of any
size, 1 % of each has the same weight. Each segment is weighted by the inverse covariance of its end
error. An unlikely segment has less weight: Huber's weights near the solution, Cauchy's, which
ignore gross errors, during the search.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry, Segment, dead_reckon, wrap_angle

CHI2_MEDIANS = {2: 1.386, 3: 2.366}  # by degrees of freedom
WEIGHT_THRESHOLD_SD = 2.0  # where weights begin to decrease
ITERATIONS_MAX = 40  # a handful is usual
STEP_TOLERANCE = 1e-9
LOG_STEP_MAX = 0.3  # the linearization does not hold further
VARIANCE_RATIO_MIN = 0.01  # so that rounding does not count as an error where the data are exact
DIAMETER_PRIOR_SD = 0.05  # relative, of the stated mean diameter

WeightFunction = Callable[[Floats], Floats]


class Residual(NamedTuple):
    """The end error of one segment, whitened: unit variance if it is as expected."""

    residuals: Floats
    """(3,), or (2,) if the heading is not known"""
    jacobian: Floats
    """(3 or 2, 3): derivatives by the unknowns"""

    @property
    def chi2(self) -> float:
        """Sum of squares, scaled to the median of three degrees of freedom."""
        scale = CHI2_MEDIANS[3] / CHI2_MEDIANS[len(self.residuals)]
        return float(self.residuals @ self.residuals) * scale


class Adjustment(NamedTuple):
    """The solution."""

    geometry: Geometry
    variance_ratio: float
    """variance of the residuals over the expected variance"""
    weights: Floats
    """(segments,)"""
    residuals: list[Residual]


def huber_weights(distance: Floats) -> Floats:
    """Weights that decrease with 1 / distance above the threshold."""
    return np.minimum(1.0, WEIGHT_THRESHOLD_SD / np.maximum(distance, WEIGHT_THRESHOLD_SD))


def cauchy_weights(distance: Floats) -> Floats:
    """Weights that decrease with 1 / distance squared."""
    return 1 / (1 + (distance / WEIGHT_THRESHOLD_SD) ** 2)


def adjust(
    segments: Sequence[Segment],
    start: Geometry,
    stated: Geometry,
    weight_function: WeightFunction,
    diameter_sd: float = DIAMETER_PRIOR_SD,
) -> Adjustment:
    """The geometry that minimizes the end errors, by Gauss-Newton iterations from `start`.

    `diameter_sd` (relative) is the standard deviation of the `stated` mean diameter.
    """
    geometry = start
    for _ in range(ITERATIONS_MAX):
        residuals, variance_ratio, weights = _reweight(segments, geometry, weight_function)
        normal, gradient = normal_equations(residuals, weights)
        prior_weight = variance_ratio / diameter_sd**2
        normal[0, 0] += prior_weight
        gradient[0] += prior_weight * np.log(geometry.mean / stated.mean)
        step = -np.linalg.lstsq(normal, gradient, rcond=None)[0]
        step = np.clip(step, -LOG_STEP_MAX, LOG_STEP_MAX)
        geometry = _apply_log_step(geometry, step)
        if np.abs(step).max() < STEP_TOLERANCE:
            break
    residuals, variance_ratio, weights = _reweight(segments, geometry, weight_function)
    return Adjustment(geometry, variance_ratio, weights, residuals)


def segment_residual(segment: Segment, geometry: Geometry) -> Residual:
    """The whitened end error of dead reckoning with `geometry`."""
    reckoned = dead_reckon(segment, geometry)
    error = reckoned.end - segment.motion
    error[2] = wrap_angle(error[2])
    known = 3 if np.isfinite(segment.motion[2]) else 2
    root = np.linalg.cholesky(reckoned.covariance[:known, :known])
    jacobian = reckoned.jacobian[:known] @ _log_jacobian(geometry)
    return Residual(np.linalg.solve(root, error[:known]), np.linalg.solve(root, jacobian))


def normal_equations(residuals: Sequence[Residual], weights: Floats) -> tuple[Floats, Floats]:
    """The normal matrix (3, 3) and the gradient (3,)."""
    normal, gradient = np.zeros((3, 3)), np.zeros(3)
    for residual, weight in zip(residuals, weights, strict=True):
        normal += weight * residual.jacobian.T @ residual.jacobian
        gradient += weight * residual.jacobian.T @ residual.residuals
    return normal, gradient


def _reweight(
    segments: Sequence[Segment], geometry: Geometry, weight_function: WeightFunction
) -> tuple[list[Residual], float, Floats]:
    residuals = [segment_residual(segment, geometry) for segment in segments]
    chi2 = np.array([residual.chi2 for residual in residuals]) / CHI2_MEDIANS[3]
    variance_ratio = max(VARIANCE_RATIO_MIN, float(np.median(chi2)))
    return residuals, variance_ratio, weight_function(np.sqrt(chi2 / variance_ratio))


def _log_jacobian(geometry: Geometry) -> Floats:
    """(3, 3): both diameters and the track by the logarithms of mean, ratio and track."""
    right, left, ratio = geometry.right, geometry.left, geometry.ratio
    return np.array(
        [
            [right, right / (ratio + 1), 0.0],
            [left, -left * ratio / (ratio + 1), 0.0],
            [0.0, 0.0, geometry.track],
        ]
    )


def _apply_log_step(geometry: Geometry, step: Floats) -> Geometry:
    mean, ratio, track = map(exp, step)
    scaled = Geometry(geometry.right * mean, geometry.left * mean, geometry.track)
    return scaled.reshaped(geometry.ratio * ratio, geometry.track * track)
