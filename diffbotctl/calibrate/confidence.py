"""Uncertainty of results: means of repeats, and fitted geometries.

Segments of one drive overlap and share its floor, so they are not independent. Drives are: the
covariance is estimated from the scatter of the gradients of whole drives (the cluster-robust
"sandwich", Liang & Zeger, Biometrika 73(1), 1986), and is at least that of the segments' own
expected errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from statistics import fmean, median, stdev
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import SEGMENT_OVERLAP, Floats
from diffbotctl.calibrate.least_squares import Adjustment, normal_equations

# Student's t for 95 %, two-sided, by degrees of freedom; the limit for more.
STUDENT_T_95 = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14)
STUDENT_T_95_LIMIT = 2.0
SCATTER_RATIO_MIN = 1e-6  # of the segments' own error; drives that scatter less are computed ones
SCATTER_SEGMENTS_MIN = 3
OUTLIER_DEVIATIONS_MIN = 5.0  # median deviations; one good reading in a thousand
MAD_TO_SD = 1.4826  # of a normal distribution


def student_t(freedom: int) -> float:
    """Student's t for 95 %, two-sided, with `freedom` degrees of freedom."""
    return STUDENT_T_95[freedom - 1] if 1 <= freedom <= len(STUDENT_T_95) else STUDENT_T_95_LIMIT


class RobustMean(NamedTuple):
    """A mean of repeats."""

    value: float
    sd: float
    """of the mean"""
    spread: float
    """standard deviation of one reading"""
    half_width: float
    """of the 95 % confidence interval of the mean"""
    outliers: tuple[int, ...]
    """indices of the readings that were left out"""


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
    half_width: float
    """of the 95 % confidence interval"""


class Confidence(NamedTuple):
    """Of all fitted values, each relative to the value."""

    right: Interval
    left: Interval
    mean: Interval
    ratio: Interval
    track: Interval


def confidence(result: Adjustment, counts: Sequence[int], diameter_sd: float) -> Confidence:
    """Confidence in `result`; `counts` is the number of segments of each drive.

    `diameter_sd`: relative standard deviation of the stated mean diameter in the fit.
    """
    covariance = _covariance(result, counts, diameter_sd)
    t = student_t(len(counts) - 1)
    ratio = result.geometry.ratio
    rows = {
        "right": (1.0, 1 / (ratio + 1), 0.0),
        "left": (1.0, -ratio / (ratio + 1), 0.0),
        "mean": (1.0, 0.0, 0.0),
        "ratio": (0.0, 1.0, 0.0),
        "track": (0.0, 0.0, 1.0),
    }
    sds = {
        name: sqrt(float(np.array(row) @ covariance @ np.array(row))) for name, row in rows.items()
    }
    return Confidence(**{name: Interval(sd, sd * t) for name, sd in sds.items()})


def _covariance(result: Adjustment, counts: Sequence[int], diameter_sd: float) -> Floats:
    """(3, 3): of the logarithms of mean, ratio and track."""
    normal, _ = normal_equations(result.residuals, result.weights)
    normal[0, 0] += result.variance_ratio / diameter_sd**2
    inverse = np.linalg.pinv(normal)
    # Some geometry explains one or two ends even if they were measured wrongly: small residuals
    # prove nothing then, so the variance is at least the expected one.
    variance_ratio = result.variance_ratio
    if sum(counts) < SCATTER_SEGMENTS_MIN:
        variance_ratio = max(variance_ratio, 1.0)
    # Overlapping segments contain the same data as many times as they overlap.
    expected = np.asarray(inverse * variance_ratio * float(min(SEGMENT_OVERLAP, max(counts))))
    drives = len(counts)
    if drives < 2:
        return expected
    gradients = np.zeros((drives, 3))
    end = 0
    for number, count in enumerate(counts):
        begin, end = end, end + count
        _, gradients[number] = normal_equations(
            result.residuals[begin:end], result.weights[begin:end]
        )
    scatter = inverse @ (gradients.T @ gradients) @ inverse * drives / (drives - 1)
    sd = np.sqrt(np.maximum(np.diag(scatter), 0.0))
    sd_min = np.sqrt(np.diag(expected))
    if (sd < SCATTER_RATIO_MIN * sd_min).any():
        return expected
    factor = np.maximum(1.0, sd_min / sd)
    return np.asarray(scatter * np.outer(factor, factor))
