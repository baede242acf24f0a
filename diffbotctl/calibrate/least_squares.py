"""Weighted least squares of the geometry over stretches, with unlikely stretches held down.

The unknowns are the natural logarithms of mean diameter, wheel ratio and track: whatever the
robot's size, one per cent of each weighs the same. Each stretch is weighted by the inverse of what
its end may be off. A stretch further off than chance allows counts for less: Huber's weights
when the answer is near, Cauchy's, which let go of gross errors altogether, when looking for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry, Segment, dead_reckon

CHI2_MEDIANS = {2: 1.386, 3: 2.366}  # of chi-squared with as many degrees of freedom
WEIGHT_THRESHOLD_SD = (
    2.0  # where weights begin to fall, in standard deviations of the sum of a stretch's three
)
ITERATIONS_MAX = 40  # of Gauss and Newton; a handful is usual
STEP_TOLERANCE = 1e-9  # relative change at which they end
LOG_STEP_MAX = 0.3  # natural logarithm; a longer step leaves what the slopes tell
VARIANCE_RATIO_MIN = (
    0.01  # of the expected variance: exact data must not make rounding look like error
)
DIAMETER_PRIOR_SD = (
    0.05  # sd of the stated mean diameter: anyone can measure a wheel better than this
)

WeightFunction = Callable[[Floats], Floats]


class Residual(NamedTuple):
    """One stretch against the truth, whitened: unit variance when all is as expected."""

    residuals: Floats
    """(3,) or, where the heading is not known, (2,)"""
    slopes: Floats
    """(3 or 2, 3): of the residuals by the unknowns"""

    @property
    def chi(self) -> float:
        """Sum of squares, scaled so that its median is that of three degrees of freedom."""
        scale = CHI2_MEDIANS[3] / CHI2_MEDIANS[len(self.residuals)]
        return float(self.residuals @ self.residuals) * scale


class Adjustment(NamedTuple):
    """Where the adjustment came to rest."""

    geometry: Geometry
    spread: float
    """variance of the misfits over the expected one"""
    weights: Floats
    """(stretches,)"""
    misfits: list[Residual]


def huber_weights(distance: Floats) -> Floats:
    """Weights that fall as one over the distance beyond EDGE."""
    return np.minimum(1.0, WEIGHT_THRESHOLD_SD / np.maximum(distance, WEIGHT_THRESHOLD_SD))


def cauchy_weights(distance: Floats) -> Floats:
    """Weights that fall as one over its square."""
    return 1 / (1 + (distance / WEIGHT_THRESHOLD_SD) ** 2)


def adjust(
    pieces: Sequence[Segment],
    start: Geometry,
    stated: Geometry,
    weigh: WeightFunction,
    diameter_sd: float = DIAMETER_PRIOR_SD,
) -> Adjustment:
    """The geometry that brings every stretch to its true end, from `start` on.

    The mean diameter is held to the `stated` one as far as `diameter_sd` (relative) says.
    """
    geometry = start
    for _ in range(ITERATIONS_MAX):
        misfits, spread, weights = _reweight(pieces, geometry, weigh)
        normal, pull = normal_equations(misfits, weights)
        hold = spread / diameter_sd**2
        normal[0, 0] += hold
        pull[0] += hold * np.log(geometry.mean / stated.mean)
        step = np.clip(-np.linalg.lstsq(normal, pull, rcond=None)[0], -LOG_STEP_MAX, LOG_STEP_MAX)
        geometry = _apply_log_step(geometry, step)
        if np.abs(step).max() < STEP_TOLERANCE:
            break
    misfits, spread, weights = _reweight(pieces, geometry, weigh)
    return Adjustment(geometry, spread, weights, misfits)


def segment_residual(piece: Segment, geometry: Geometry) -> Residual:
    """How far dead reckoning with `geometry` misses the true end of `piece`."""
    reckoned = dead_reckon(piece, geometry)
    gap = reckoned.end - piece.moved
    gap[2] = np.remainder(gap[2] + np.pi, 2 * np.pi) - np.pi
    known = 3 if np.isfinite(piece.moved[2]) else 2
    root = np.linalg.cholesky(reckoned.covariance[:known, :known])
    slopes = reckoned.slope[:known] @ _log_jacobian(geometry)
    return Residual(np.linalg.solve(root, gap[:known]), np.linalg.solve(root, slopes))


def normal_equations(misfits: Sequence[Residual], weights: Floats) -> tuple[Floats, Floats]:
    """(3, 3) and (3,): the sums of squares of slopes, and of slopes times residuals."""
    normal, pull = np.zeros((3, 3)), np.zeros(3)
    for each, weight in zip(misfits, weights, strict=True):
        normal += weight * each.slopes.T @ each.slopes
        pull += weight * each.slopes.T @ each.residuals
    return normal, pull


def _reweight(
    pieces: Sequence[Segment], geometry: Geometry, weigh: WeightFunction
) -> tuple[list[Residual], float, Floats]:
    misfits = [segment_residual(piece, geometry) for piece in pieces]
    chi = np.array([each.chi for each in misfits])
    spread = max(VARIANCE_RATIO_MIN, float(np.median(chi)) / CHI2_MEDIANS[3])
    return misfits, spread, weigh(np.sqrt(chi / CHI2_MEDIANS[3] / spread))


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
    mean, ratio, track = (exp(each) for each in step)
    scaled = Geometry(geometry.right * mean, geometry.left * mean, geometry.track)
    return scaled.reshaped(geometry.ratio * ratio, geometry.track * track)
