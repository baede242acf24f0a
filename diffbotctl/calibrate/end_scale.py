"""Whether x and y of the true poses were measured with the same scale.

A scale of one axis is a fourth unknown beside the three of the geometry. Drives in several
directions determine it. Drives that all end ahead of their start do not: there a scale of 5 % and
wheels that are larger by 5 % are the same. Only the ruler's measure of the wheels is left then: a
scale that brings them within 3 % of it cannot be found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import expm1
from typing import Literal, NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry, RecordedDrive
from diffbotctl.calibrate.end_noise import NoiseGrid, linearize
from diffbotctl.calibrate.geometry_posterior import GeometryPrior, average_over_noise
from diffbotctl.calibrate.log_mistakes import Cut, Explanation

SCALE_SD = 0.1  # of the prior; other units are found by log_mistakes.py
DIFFERENCE = 1e-4  # relative
# Factors of the poses that make one axis longer by it.
LONGER_AXIS: dict[Literal["x", "y"], tuple[float, float, float]] = {
    "x": (1.0 + DIFFERENCE, 1.0, 1.0),
    "y": (1.0, 1.0 + DIFFERENCE, 1.0),
}
CERTAIN_SDS = 3.5
CERTAIN_LOG_MIN = 0.02
SUSPECT_SDS = 2.5
# Of the mean diameter. A ruler measures a wheel of 65 mm to 1 mm, which is 1.5 %.
SUSPECT_MEAN_LOG = 0.03
MEAN_CHANGE_LOG_MIN = 0.02  # below, the wheels hardly depend on the scale
# Logarithm of the probability of each of the scales that explain_ends tries, to that of one scale
# for both axes: with six of them, one set in 25 has another scale along an axis.
OTHER_SCALE_LOG_PRIOR = -5.0


class EndScale(NamedTuple):
    """The scale of one axis, and the wheels that go with it."""

    axis: Literal["x", "y"]
    log: float
    """logarithm of the noted over the true values"""
    sd: float
    mean_log: float
    """logarithm of the mean diameter over the stated one, if this axis has a scale of its own"""


def end_scales(
    drives: Sequence[RecordedDrive],
    cut: Cut,
    geometry: Geometry,
    prior: GeometryPrior,
    noise: NoiseGrid,
) -> list[EndScale]:
    """Estimate the scale of x, and that of y; `geometry` is near the best one."""
    segments, weights = cut(drives)
    linear = linearize(segments, geometry)
    precision = np.diag(1 / np.square([*prior.sds, SCALE_SD]))
    offset = np.append(prior.offset(geometry), 0.0)
    scales = []
    for axis, factors in LONGER_AXIS.items():
        scaled, _ = cut([replace(drive, poses=drive.poses * factors) for drive in drives])
        by_scale = np.array(
            [
                (long.motion - segment.motion) / DIFFERENCE
                for segment, long in zip(segments, scaled, strict=True)
            ]
        )
        by_scale[:, 2] = 0.0  # headings have no length, and some are not known
        jacobians = np.concatenate([linear.jacobians, by_scale[:, :, None]], axis=2)
        _, mean, covariance = average_over_noise(
            replace(linear, jacobians=jacobians), weights, noise, precision, offset
        )
        sd = float(covariance[3, 3] ** 0.5)
        scales.append(EndScale(axis, float(mean[3]), sd, float(offset[0] + mean[0])))
    return scales


def scale_covariance(found: Explanation, prior: GeometryPrior) -> Floats:
    """(3, 3): of the logarithms of mean diameter, ratio and track, since an axis may have another
    scale than the other one."""
    solutions = [each for _, each in found.scaled]
    logs = [each.score - found.plain.score + OTHER_SCALE_LOG_PRIOR for each in solutions]
    weights = np.exp(np.array([0.0, *logs]) - np.logaddexp.reduce([0.0, *logs]))[1:]
    middle = prior.offset(found.plain.geometry)
    changes = np.array([prior.offset(each.geometry) - middle for each in solutions])
    return np.asarray((changes.T * weights) @ changes) if len(changes) else np.zeros((3, 3))


def refuse_unknown_scale(found: Explanation, covariance: Floats, sd_max: float) -> None:
    """Raises ValueError if the scale of an axis alone makes the mean diameter too uncertain.

    `covariance` as by scale_covariance; `sd_max`: relative.
    """
    if covariance[0, 0] <= sd_max**2:
        return
    text, _ = max(found.scaled, key=lambda each: each[1].score)
    raise ValueError(
        f"these drives do not show whether {text}, or add drives that end in other directions"
    )


def refuse_other_scale(scales: Sequence[EndScale], mean_log: float) -> None:
    """Raises ValueError if an axis has another scale, or may have it and the wheels depend on it.

    `mean_log`: logarithm of the mean diameter over the stated one, with one scale for both axes.
    """
    for scale in scales:
        percent = 100 * abs(scale.log)
        deviation = abs(scale.log) / scale.sd
        if deviation > CERTAIN_SDS and abs(scale.log) > CERTAIN_LOG_MIN:
            long, short = ("x", "y") if (scale.axis == "x") == (scale.log > 0.0) else ("y", "x")
            raise ValueError(
                f"these drives agree with each other only if {long} of the true poses is about "
                f"{percent:.0f} % too long, or {short} too short: measure both with the same tape"
            )
        is_suspect = abs(mean_log) > SUSPECT_MEAN_LOG or deviation > SUSPECT_SDS
        if is_suspect and abs(mean_log - scale.mean_log) > MEAN_CHANGE_LOG_MIN:
            size = "larger" if mean_log > 0.0 else "smaller"
            length = "long" if scale.log > 0.0 else "short"
            raise ValueError(
                f"either the wheels are {100 * abs(expm1(mean_log)):.0f} % {size} than stated, or "
                f"{scale.axis} of the true poses is {percent:.0f} % too {length}: these drives do "
                "not show which. Check the tape, measure the wheels and correct the robot file, or "
                "add drives that end in other directions"
            )
