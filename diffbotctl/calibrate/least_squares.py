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

from diffbotctl.calibrate.dead_reckoning import dead_reckon
from diffbotctl.calibrate.geometry import Geometry
from diffbotctl.calibrate.recorded_drive import Floats, Segment

MEDIANS = {2: 1.386, 3: 2.366}  # of chi-squared with as many degrees of freedom
EDGE = 2.0  # where weights begin to fall, in standard deviations of the sum of a stretch's three
ROUNDS = 40  # of Gauss and Newton; a handful is usual
STILL = 1e-9  # relative change at which they end
LONGEST = 0.3  # natural logarithm; a longer step leaves what the slopes tell
LEAST_SPREAD = 0.01  # of the expected variance: exact data must not make rounding look like error
DIAMETER_PRIOR = 0.05  # sd of the stated mean diameter: anyone can measure a wheel better than this

Weight = Callable[[Floats], Floats]


class Residual(NamedTuple):
    """One stretch against the truth, whitened: unit variance when all is as expected."""

    residuals: Floats
    """(3,) or, where the heading is not known, (2,)"""
    slopes: Floats
    """(3 or 2, 3): of the residuals by the unknowns"""

    @property
    def chi(self) -> float:
        """Sum of squares, scaled so that its median is that of three degrees of freedom."""
        scale = MEDIANS[3] / MEDIANS[len(self.residuals)]
        return float(self.residuals @ self.residuals) * scale


class Adjustment(NamedTuple):
    """Where the adjustment came to rest."""

    geometry: Geometry
    spread: float
    """variance of the misfits over the expected one"""
    weights: Floats
    """(stretches,)"""
    misfits: list[Residual]


def huber(distance: Floats) -> Floats:
    """Weights that fall as one over the distance beyond EDGE."""
    return np.minimum(1.0, EDGE / np.maximum(distance, EDGE))


def cauchy(distance: Floats) -> Floats:
    """Weights that fall as one over its square."""
    return 1 / (1 + (distance / EDGE) ** 2)


def adjust(
    pieces: Sequence[Segment],
    start: Geometry,
    stated: Geometry,
    weigh: Weight,
    diameter_sd: float = DIAMETER_PRIOR,
) -> Adjustment:
    """The geometry that brings every stretch to its true end, from `start` on.

    The mean diameter is held to the `stated` one as far as `diameter_sd` (relative) says.
    """
    geometry = start
    for _ in range(ROUNDS):
        misfits, spread, weights = _weighed(pieces, geometry, weigh)
        normal, pull = normal_equations(misfits, weights)
        hold = spread / diameter_sd**2
        normal[0, 0] += hold
        pull[0] += hold * np.log(geometry.mean / stated.mean)
        step = np.clip(-np.linalg.lstsq(normal, pull, rcond=None)[0], -LONGEST, LONGEST)
        geometry = _moved(geometry, step)
        if np.abs(step).max() < STILL:
            break
    misfits, spread, weights = _weighed(pieces, geometry, weigh)
    return Adjustment(geometry, spread, weights, misfits)


def residual(piece: Segment, geometry: Geometry) -> Residual:
    """How far dead reckoning with `geometry` misses the true end of `piece`."""
    reckoned = dead_reckon(piece, geometry)
    gap = reckoned.end - piece.moved
    gap[2] = np.remainder(gap[2] + np.pi, 2 * np.pi) - np.pi
    known = 3 if np.isfinite(piece.moved[2]) else 2
    root = np.linalg.cholesky(reckoned.covariance[:known, :known])
    slopes = reckoned.slope[:known] @ _by_logarithms(geometry)
    return Residual(np.linalg.solve(root, gap[:known]), np.linalg.solve(root, slopes))


def normal_equations(misfits: Sequence[Residual], weights: Floats) -> tuple[Floats, Floats]:
    """(3, 3) and (3,): the sums of squares of slopes, and of slopes times residuals."""
    normal, pull = np.zeros((3, 3)), np.zeros(3)
    for each, weight in zip(misfits, weights, strict=True):
        normal += weight * each.slopes.T @ each.slopes
        pull += weight * each.slopes.T @ each.residuals
    return normal, pull


def _weighed(
    pieces: Sequence[Segment], geometry: Geometry, weigh: Weight
) -> tuple[list[Residual], float, Floats]:
    misfits = [residual(piece, geometry) for piece in pieces]
    chi = np.array([each.chi for each in misfits])
    spread = max(LEAST_SPREAD, float(np.median(chi)) / MEDIANS[3])
    return misfits, spread, weigh(np.sqrt(chi / MEDIANS[3] / spread))


def _by_logarithms(geometry: Geometry) -> Floats:
    """(3, 3): both diameters and the track by the logarithms of mean, ratio and track."""
    right, left, ratio = geometry.right, geometry.left, geometry.ratio
    return np.array(
        [
            [right, right / (ratio + 1), 0.0],
            [left, -left * ratio / (ratio + 1), 0.0],
            [0.0, 0.0, geometry.track],
        ]
    )


def _moved(geometry: Geometry, step: Floats) -> Geometry:
    mean, ratio, track = (exp(each) for each in step)
    scaled = Geometry(geometry.right * mean, geometry.left * mean, geometry.track)
    return scaled.reshaped(geometry.ratio * ratio, geometry.track * track)
