"""How the ends of drives may have been noted by mistake, and the geometries that explain them.

Ends that another convention of their coordinates explains far better are refused. Two mistakes
cannot be distinguished from a correct file: counts of both wheels exchanged are the same as ends
mirrored; and without headings, x and y exchanged in squares look like a wrong track taken for
unequal wheels (UMBmark's two angles change places).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from math import log, pi
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import (
    Floats,
    Geometry,
    RecordedDrive,
    drive_segments,
    flattened,
)
from diffbotctl.calibrate.end_noise import SEARCH_NOISE
from diffbotctl.calibrate.geometry_posterior import GeometryPrior, Solution, solve
from diffbotctl.calibrate.geometry_search import are_near, search

SEARCH_SEGMENTS_MAX = 24  # of all drives, to find mistakes
BAD_DRIVES_RATIO_MAX = 1 / 3
HALF_WIDTH_MAX = 0.05  # relative, of the 95 % confidence interval of each value
RIVAL_LOG_RATIO_MIN = 4.0  # 55 to 1
# Logarithm of the density ratio from which another convention of the ends is accepted: 1000 to 1.
CONVENTION_LOG_RATIO_MIN = 7.0
# Logarithm of the probability of another scale along an axis, to that of one scale for both.
OTHER_SCALE_LOG_PRIOR = -5.0
SCALES = (0.9, 0.94, 0.97, 1.03, 1.06, 1.1)  # of x or y
ONE_SCALE_PROBABILITY_MIN = 0.5
MM = 1000.0


class Convention(NamedTuple):
    """How ends may have been noted by mistake, and what undoes it."""

    text: str
    columns: tuple[int, int, int] = (0, 1, 2)
    factors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """of x, y and heading, after the columns were put in order"""


SWAPPED = (1, 0, 2)
CONVENTIONS = (
    Convention(
        "the true poses are mirrored (y is positive to the left, headings counter-clockwise), or "
        "the counts of the left and the right wheel are exchanged",
        factors=(1, -1, -1),
    ),
    Convention("x and y of the true poses are exchanged: x is ahead, y to the left", SWAPPED),
    Convention(
        "y of the true poses has the wrong sign: it is positive to the left", factors=(1, -1, 1)
    ),
    Convention("x of the true poses has the wrong sign: it is positive ahead", factors=(-1, 1, 1)),
    Convention(
        "the headings of the true poses have the wrong sign: counter-clockwise is positive",
        factors=(1, 1, -1),
    ),
    Convention(
        "x and y of the true poses are in millimetres, but must be in metres",
        factors=(0.001, 0.001, 1),
    ),
    Convention(
        "x and y of the true poses are in centimetres, but must be in metres",
        factors=(0.01, 0.01, 1),
    ),
    Convention(
        "the headings of the true poses are in degrees, but must be in rad",
        factors=(1, 1, pi / 180),
    ),
)


def plausible_geometry(drives: Sequence[RecordedDrive], prior: GeometryPrior) -> Solution:
    """The most likely geometry. Raises ValueError if another one, or the mirror image of the ends,
    explains them as well."""
    best, *others = _search(drives, prior)
    refuse_convention(drives, prior, best, CONVENTIONS[:1])
    for rival in others:
        is_as_good = _is_good(best) and best.score - rival.score < RIVAL_LOG_RATIO_MIN
        if is_as_good and not are_near(best, rival, HALF_WIDTH_MAX):
            raise ValueError(
                "two geometries explain these ends equally well: a track of "
                f"{best.geometry.track * MM:.1f} mm and one of {rival.geometry.track * MM:.1f} mm; "
                "add shorter drives with fewer turns"
            )
    return best


def _search(drives: Sequence[RecordedDrive], prior: GeometryPrior) -> list[Solution]:
    return search(*flattened(drive_segments(drives, prior.stated, SEARCH_SEGMENTS_MAX, 1)), prior)


def _is_good(solution: Solution) -> bool:
    return float(np.mean(solution.good < 0.5)) <= BAD_DRIVES_RATIO_MAX


def refuse_convention(
    drives: Sequence[RecordedDrive],
    prior: GeometryPrior,
    plain: Solution,
    conventions: Sequence[Convention],
) -> None:
    """Raises ValueError if one of `conventions` explains the ends much better than `plain`."""
    for text, columns, factors in conventions:
        poses = [drive.poses[:, columns] * factors for drive in drives]
        read = [replace(drive, poses=each) for drive, each in zip(drives, poses, strict=True)]
        found = _search(read, prior)[0]
        # Other units change the density of the same ends by their Jacobian.
        known = np.isfinite([drive.poses[-1] for drive in drives]).sum(axis=0)
        score = found.score + float(known @ np.log(np.abs(factors)))
        if _is_good(found) and score > plain.score + CONVENTION_LOG_RATIO_MIN:
            raise ValueError(f"these drives agree with each other only if {text}")


def scale_covariance(
    drives: Sequence[RecordedDrive], prior: GeometryPrior, geometry: Geometry
) -> Floats:
    """(3, 3): of the logarithms of mean diameter, ratio and track, since x of the ends may have
    another scale than y. Raises ValueError if it probably has.

    Which axis is wrong the ends do not show: their common scale is that of the wheels.
    """
    segments, weights = flattened(drive_segments(drives, prior.stated, SEARCH_SEGMENTS_MAX, 1))
    plain = solve(segments, weights, geometry, prior, SEARCH_NOISE)
    logs, changes = [0.0], [np.zeros(3)]
    for axis, factor in product((0, 1), SCALES):
        factors = np.where(np.arange(3) == axis, factor, 1.0)
        scaled = [replace(each, motion=each.motion * factors) for each in segments]
        solution = solve(scaled, weights, geometry, prior, SEARCH_NOISE)
        # Other units change the density of the same ends by their Jacobian.
        gain = solution.score - plain.score + log(factor) * float(weights.sum())
        logs.append(gain + OTHER_SCALE_LOG_PRIOR)
        changes.append(prior.offset(solution.geometry) - prior.offset(plain.geometry))
    shares, change = np.exp(np.array(logs) - np.logaddexp.reduce(logs)), np.array(changes)
    if shares[0] < ONE_SCALE_PROBABILITY_MIN:
        axis, number = divmod(int(np.argmax(shares[1:])), len(SCALES))
        factor = SCALES[number]
        is_x_long = (axis == 0) == (factor < 1)
        raise ValueError(
            f"these drives agree with each other only if {'yx'[is_x_long]} of the true poses is "
            f"about {100 * abs(log(factor)):.0f} % too long, or {'xy'[is_x_long]} too short: "
            "measure both with the same tape"
        )
    return np.asarray((change.T * shares) @ change)
