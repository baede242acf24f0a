"""How far results can be trusted: means of repeats, and fitted geometries.

Segments of one drive overlap and share its floor, so they do not count as independent evidence.
Drives do: the variance is taken from how the gradients of whole drives scatter (the cluster-robust
"sandwich", Liang & Zeger, Biometrika 73(1), 1986), and is never let below what the segments' own
errors imply.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import sqrt
from statistics import fmean, median, stdev
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import SEGMENT_OVERLAP, Floats
from diffbotctl.calibrate.least_squares import Adjustment, normal_equations

# Student's t for 95 % both sides, by degrees of freedom; what follows is 2.
STUDENT_T_95 = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14)
STUDENT_T_95_LIMIT = 2.0
SCATTER_RATIO_MIN = 1e-6  # of the floor: drives that scatter less are computed ones
SCATTER_SEGMENTS_MIN = 3  # that tell how far they scatter
OUTLIER_DEVIATIONS = (
    5.0  # times the median deviation that makes a reading a stray one: one in a thousand
)
MAD_TO_SD = 1.4826  # of a normal distribution's median deviation


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
    """half of the mean's 95 % confidence interval"""
    outliers: tuple[int, ...]
    """places of the readings that were left out"""


def robust_mean(readings: Sequence[float], finest: float) -> RobustMean:
    """The mean of `readings` without stray ones.

    `finest`: the standard deviation below which no spread is believed, which is also that of a
    single reading. Raises ValueError without any.
    """
    if not readings:
        raise ValueError("no readings")
    middle = median(readings)
    typical = max(MAD_TO_SD * median(abs(each - middle) for each in readings), finest)
    outliers = tuple(
        number
        for number, each in enumerate(readings)
        if abs(each - middle) > OUTLIER_DEVIATIONS * typical
    )
    good = [each for number, each in enumerate(readings) if number not in outliers]
    spread = max(stdev(good), finest) if len(good) > 1 else finest
    sd = spread / sqrt(len(good))
    return RobustMean(fmean(good), sd, spread, student_t(len(good) - 1) * sd, outliers)


class Interval(NamedTuple):
    """Relative error of one length, or of the ratio."""

    sd: float
    half_width: float
    """half the width of the 95 % confidence interval"""


class Confidence(NamedTuple):
    """Of everything that was fitted; each relative to the value itself."""

    right: Interval
    left: Interval
    mean: Interval
    ratio: Interval
    track: Interval


def confidence(result: Adjustment, counts: Sequence[int], diameter_sd: float) -> Confidence:
    """Confidence in `result`, of which each drive brought as many pieces as `counts` says.

    `diameter_sd`: how well (relative) the mean diameter was held to the stated one.
    """
    covariance = _covariance(result, counts, diameter_sd)
    student = student_t(len(counts) - 1)
    ratio = result.geometry.ratio
    by = {
        "right": np.array([1.0, 1 / (ratio + 1), 0.0]),
        "left": np.array([1.0, -ratio / (ratio + 1), 0.0]),
        "mean": np.array([1.0, 0.0, 0.0]),
        "ratio": np.array([0.0, 1.0, 0.0]),
        "track": np.array([0.0, 0.0, 1.0]),
    }
    found = {name: sqrt(float(row @ covariance @ row)) for name, row in by.items()}
    return Confidence(**{name: Interval(sd, sd * student) for name, sd in found.items()})


def _covariance(result: Adjustment, counts: Sequence[int], diameter_sd: float) -> Floats:
    """(3, 3): of the logarithms of mean, ratio and track."""
    normal, _ = normal_equations(result.misfits, result.weights)
    normal[0, 0] += result.spread / diameter_sd**2
    inverse = np.linalg.pinv(normal)
    # Overlapping pieces say the same several times: as many as lie over one another.
    # An end or two are explained by some geometry however wrong they were measured: how little is
    # missed then proves nothing, so their errors are taken to be what is expected of them.
    spread = result.spread if sum(counts) >= SCATTER_SEGMENTS_MIN else max(result.spread, 1.0)
    pieces_own = inverse * spread * float(min(SEGMENT_OVERLAP, max(counts)))
    if len(counts) < 2:
        return np.asarray(pieces_own)
    ends = np.cumsum([0, *counts])
    pulls = np.array(
        [
            normal_equations(result.misfits[a:b], result.weights[a:b])[1]
            for a, b in pairwise(ends.tolist())
        ]
    )
    drives = len(counts)
    scatter = inverse @ (pulls.T @ pulls) @ inverse * drives / (drives - 1)
    sd = np.sqrt(np.maximum(np.diag(scatter), 0.0))
    floor = np.sqrt(np.diag(pieces_own))
    if (sd < SCATTER_RATIO_MIN * floor).any():
        return np.asarray(pieces_own)
    stretch = np.maximum(1.0, floor / sd)
    return np.asarray(scatter * np.outer(stretch, stretch))
