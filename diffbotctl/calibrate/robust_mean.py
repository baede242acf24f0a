"""One number from repeats: the stray ones named, the mean with its confidence."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from statistics import fmean, median, stdev
from typing import NamedTuple

from diffbotctl.calibrate.geometry_fit import MANY, STUDENT

STRAY = 5.0  # times the median deviation that makes a reading a stray one: one in a thousand
TO_SD = 1.4826  # of a normal distribution's median deviation


class RobustMean(NamedTuple):
    """A mean of repeats."""

    value: float
    sd: float
    """of the mean"""
    spread: float
    """standard deviation of one reading"""
    half: float
    """half of the mean's 95 % confidence interval"""
    strays: tuple[int, ...]
    """places of the readings that were left out"""


def robust_mean(readings: Sequence[float], finest: float) -> RobustMean:
    """The mean of `readings` without stray ones.

    `finest`: the standard deviation below which no spread is believed, which is also that of a
    single reading. Raises ValueError without any.
    """
    if not readings:
        raise ValueError("no readings")
    middle = median(readings)
    typical = max(TO_SD * median(abs(each - middle) for each in readings), finest)
    strays = tuple(
        number for number, each in enumerate(readings) if abs(each - middle) > STRAY * typical
    )
    good = [each for number, each in enumerate(readings) if number not in strays]
    spread = max(stdev(good), finest) if len(good) > 1 else finest
    sd = spread / sqrt(len(good))
    freedom = len(good) - 1
    student = STUDENT[freedom - 1] if 1 <= freedom <= len(STUDENT) else MANY
    return RobustMean(fmean(good), sd, spread, student * sd, strays)
