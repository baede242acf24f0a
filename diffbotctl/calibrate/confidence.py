"""Uncertainty of results: means of repeats, and fitted geometries.

Segments of one drive overlap and share its floor, so they are not independent. Drives are: where a
drive has several segments, the covariance is at least that of the scatter of the gradients of whole
drives (the cluster-robust "sandwich", Liang & Zeger, Biometrika 73(1), 1986).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from statistics import fmean, median, stdev
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, Segment
from diffbotctl.calibrate.end_noise import linearize
from diffbotctl.calibrate.geometry_posterior import Posterior

# Student's t for 95 %, two-sided, by degrees of freedom; the limit for more.
STUDENT_T_95 = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14)
STUDENT_T_95_LIMIT = 2.0
SCATTER_DRIVES_MIN = 3
OUTLIER_DEVIATIONS_MIN = 5.0  # median deviations; one good reading in a thousand
MAD_TO_SD = 1.4826  # of a normal distribution


def student_t(freedom: int) -> float:
    """Student's t for 95 %, two-sided, with `freedom` degrees of freedom."""
    return STUDENT_T_95[freedom - 1] if 1 <= freedom <= len(STUDENT_T_95) else STUDENT_T_95_LIMIT


class RobustMean(NamedTuple):
    """A mean of repeats."""

    value: float
    sd: float  # of the mean
    spread: float  # standard deviation of one reading
    half_width: float  # of the 95 % confidence interval of the mean
    outliers: tuple[int, ...]  # indices of the readings that were left out


def robust_mean(readings: Sequence[float], sd_min: float) -> RobustMean:
    """The mean of `readings` without outliers.

    `sd_min`: the smallest plausible standard deviation, which is that of a single reading too.
    Raises ValueError without readings.
    """
    if not readings:
        raise ValueError("no readings")
    middle = median(readings)
    deviations = [abs(reading - middle) for reading in readings]
    limit = OUTLIER_DEVIATIONS_MIN * max(MAD_TO_SD * median(deviations), sd_min)
    outliers = tuple(number for number, deviation in enumerate(deviations) if deviation > limit)
    good = [reading for number, reading in enumerate(readings) if number not in outliers]
    spread = max(stdev(good), sd_min) if len(good) > 1 else sd_min
    sd = spread / sqrt(len(good))
    return RobustMean(fmean(good), sd, spread, student_t(len(good) - 1) * sd, outliers)


class Interval(NamedTuple):
    """Relative error of one length, or of the ratio."""

    sd: float
    half_width: float  # of the 95 % confidence interval


class Confidence(NamedTuple):
    """Of all fitted values, each relative to the value."""

    right: Interval
    left: Interval
    mean: Interval
    ratio: Interval
    track: Interval
    track_over_mean: Interval


def confidence(
    result: Posterior,
    counts: Sequence[int],
    segments: Sequence[Segment],
    weights: Floats,
) -> Confidence:
    """Confidence in `result`; `counts` is the number of segments of each drive."""
    covariance = result.covariance
    if len(counts) >= SCATTER_DRIVES_MIN and max(counts) > 1:
        covariance = _at_least(covariance, _drive_scatter(result, counts, segments, weights))
    ratio = result.geometry.ratio
    rows = {
        "right": (1.0, 1 / (ratio + 1), 0.0),
        "left": (1.0, -ratio / (ratio + 1), 0.0),
        "mean": (1.0, 0.0, 0.0),
        "ratio": (0.0, 1.0, 0.0),
        "track": (0.0, 0.0, 1.0),
        "track_over_mean": (-1.0, 0.0, 1.0),
    }
    sds = {
        name: sqrt(float(np.array(row) @ covariance @ np.array(row))) for name, row in rows.items()
    }
    return Confidence(**{name: Interval(sd, sd * STUDENT_T_95_LIMIT) for name, sd in sds.items()})


def _at_least(covariance: Floats, scatter: Floats) -> Floats:
    """`covariance` with each standard deviation at least that of `scatter`."""
    factor = np.sqrt(np.maximum(np.diag(scatter) / np.diag(covariance), 1.0))
    return np.asarray(covariance * np.outer(factor, factor))


def _drive_scatter(
    result: Posterior, counts: Sequence[int], segments: Sequence[Segment], weights: Floats
) -> Floats:
    """(3, 3): covariance from the scatter of the gradients of whole drives, so that two of its
    standard deviations contain 95 % of Student's t with as many degrees of freedom as drives."""
    linear = linearize(segments, result.geometry)
    precisions = np.linalg.inv(linear.covariances(result.noise)[0])
    weighted = precisions * weights[:, None, None]
    jacobians, residuals = linear.jacobians, linear.residuals
    normal = np.einsum("nki,nkl,nlj->ij", jacobians, weighted, jacobians)
    gradients = np.einsum("nki,nkl,nl->ni", jacobians, weighted, residuals)
    sums = np.add.reduceat(gradients, np.concatenate(([0], np.cumsum(counts)[:-1])), axis=0)
    inverse = np.linalg.pinv(normal)
    drives = len(counts)
    widening = (student_t(drives - 1) / STUDENT_T_95_LIMIT) ** 2
    return np.asarray(inverse @ (sums.T @ sums) @ inverse * drives / (drives - 1) * widening)
