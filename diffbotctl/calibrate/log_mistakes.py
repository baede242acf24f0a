"""Mistakes in the files of recorded drives, found by what would explain the measured ends.

Each mistake is a hypothesis: a change of the counts or of the poses that undoes it. The hypothesis
with the highest posterior density wins; without a mistake is one of them. A change of units changes
the density of the same data by its Jacobian, so that small numbers do not look like good ones.

Two mistakes cannot be distinguished from a correct file in principle: counts of both wheels
exchanged are the same as ends mirrored; and without headings, x and y exchanged in squares look
like a wrong track taken for unequal wheels (UMBmark's two angles change places).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import degrees, log, pi, radians, sqrt
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, RecordedDrive, Segment
from diffbotctl.calibrate.geometry_posterior import GeometryPrior, Solution, squared_error
from diffbotctl.calibrate.geometry_search import EndGrid

Drives = Sequence[RecordedDrive]
Cut = Callable[[Drives], tuple[list[Segment], Floats]]
"""From drives to their segments and the weights of these"""
# Logarithm of the density ratio from which a mistake is believed: 1000 to 1. Few users make one.
MISTAKE_LOG_RATIO_MIN = 7.0
POLISH_LOG_RATIO_MIN = -12.0  # a hypothesis that is worse on the grid is not refined
SHIFT_DRIVES_MIN = 3
USUAL_NOISE = (0.0007, 0.004, radians(2.0), radians(0.5))  # slip, position, heading, start
USUAL_CHI2_RATIO_MAX = 3.0  # for each of three coordinates
MISTAKE_MAXIMA = 2  # of the grid, refined for each mistake
# A little more than one turn: headings in rad that were wrapped, which most are.
RADIANS_MAX = 6.4


class Mistake(NamedTuple):
    """A hypothesis: what is wrong, and the drives without it."""

    text: str
    drives: list[RecordedDrive]
    position_scale: float = 1.0
    """of corrected over noted positions"""
    heading_scale: float = 1.0
    changes_counts: bool = False
    is_axis_scale: bool = False


@dataclass(frozen=True, slots=True)
class Explanation:
    """The most likely hypothesis."""

    mistake: Mistake | None
    solution: Solution
    """without the mistake"""
    plain: Solution
    """with the files as they are"""
    rival: Solution | None
    """the second-best geometry for the files as they are"""
    good_ratio: float
    """of the ends that the solution explains"""
    scaled: list[tuple[str, Solution]]
    """x and y of different scales, in words, and the solutions without them, whose scores are for
    the files as they are"""


def explain_ends(drives: Drives, prior: GeometryPrior, cut: Cut) -> Explanation:
    """Whether a mistake explains the ends much better than the files as they are."""
    segments, weights = cut(drives)
    grid = EndGrid(segments, prior)
    plain, *others = grid.solutions(segments, weights)
    limit = float(grid.scores(segments, weights).max()) + POLISH_LOG_RATIO_MIN
    best: tuple[float, Mistake, Solution] | None = None
    mistakes = [*_pose_mistakes(drives), *_unit_mistakes(drives), *_order_mistakes(drives)]
    mistakes += [*_axis_scale_mistakes(drives), *_point_mistakes(drives)]
    if not _is_usual(segments, weights, plain):
        mistakes += _count_mistakes(drives)
    scaled = []
    for mistake in mistakes:
        segments, weights = cut(mistake.drives)
        own_grid = EndGrid(segments, prior) if mistake.changes_counts else grid
        offset = _log_jacobian(mistake, segments, weights)
        if float(own_grid.scores(segments, weights).max()) + offset < limit:
            continue
        solution = own_grid.solutions(segments, weights, MISTAKE_MAXIMA)[0]
        score = solution.score + offset
        if mistake.is_axis_scale:
            scaled.append((mistake.text, replace(solution, score=score)))
        if best is None or score > best[0]:
            best = score, mistake, solution
    rival = others[0] if others else None
    if best is not None and best[0] > plain.score + MISTAKE_LOG_RATIO_MIN:
        _, mistake, solution = best
        _, weights = cut(mistake.drives)
        good_ratio = _good_ratio(solution, weights)
        return Explanation(mistake, solution, plain, rival, good_ratio, scaled)
    _, weights = cut(drives)
    return Explanation(None, plain, plain, rival, _good_ratio(plain, weights), scaled)


def _good_ratio(solution: Solution, weights: Floats) -> float:
    return float(np.average(solution.good, weights=weights))


def _is_usual(segments: Sequence[Segment], weights: Floats, plain: Solution) -> bool:
    """Whether the ends are as near as those of careful measurements: wrong counts are not."""
    if plain.good.min() < 0.5:
        return False
    chi2 = squared_error(segments, weights, plain.geometry, USUAL_NOISE)
    return chi2 < USUAL_CHI2_RATIO_MAX * 3 * float(weights.sum())


def _log_jacobian(mistake: Mistake, segments: Sequence[Segment], weights: Floats) -> float:
    known = np.array([bool(np.isfinite(segment.motion[2])) for segment in segments])
    position = 2 * log(abs(mistake.position_scale)) * weights.sum()
    return float(position + log(abs(mistake.heading_scale)) * weights[known].sum())


UNITS = {
    "millimetres": 0.001,
    "centimetres": 0.01,
    "inches": 0.0254,
    "decimetres": 0.1,
    "feet": 0.3048,
}
# Of x; a factor of both x and y means wheels of another size.
AXIS_SCALES = (0.9, 0.94, 0.97, 1.03, 1.06, 1.1)
POINTS_AHEAD_M = (-0.1, 0.05, 0.1, 0.18)  # of the middle of the axle: its tail, its nose
TICK_FACTORS = {
    "half as many": 2.0,
    "a quarter as many": 4.0,
    "twice as many": 0.5,
    "four times as many": 0.25,
}


def _pose_mistakes(drives: Drives) -> list[Mistake]:
    """Axes and signs of the true poses."""
    cases: list[tuple[str, tuple[int, int], tuple[int, int, int]]] = [
        ("x and y of the true poses are exchanged: x is ahead, y to the left", (1, 0), (1, 1, 1)),
        (
            "the true poses are mirrored (y is positive to the left, headings counter-clockwise), "
            "or the counts of the left and the right wheel are exchanged",
            (0, 1),
            (1, -1, -1),
        ),
        ("y of the true poses has the wrong sign: it is positive to the left", (0, 1), (1, -1, 1)),
        (
            "the headings of the true poses have the wrong sign: counter-clockwise is positive",
            (0, 1),
            (1, 1, -1),
        ),
        ("x of the true poses has the wrong sign: it is positive ahead", (0, 1), (-1, 1, 1)),
        (
            "x and y of the true poses have the wrong sign: they are the end seen from the start",
            (0, 1),
            (-1, -1, 1),
        ),
        (
            "x and y of the true poses are exchanged and y has the wrong sign: "
            "x is ahead, y to the left",
            (1, 0),
            (1, -1, 1),
        ),
        (
            "x and y of the true poses are exchanged and x has the wrong sign: "
            "x is ahead, y to the left",
            (1, 0),
            (-1, 1, 1),
        ),
    ]
    return [
        Mistake(text, [_with_poses(drive, axes, signs) for drive in drives])
        for text, axes, signs in cases
    ]


def _with_poses(
    drive: RecordedDrive, axes: tuple[int, int], signs: tuple[int, int, int]
) -> RecordedDrive:
    return replace(drive, poses=drive.poses[:, [*axes, 2]] * signs)


def _unit_mistakes(drives: Drives) -> list[Mistake]:
    """Units of the true poses."""
    found = []
    for unit, scale in UNITS.items():
        scaled = [replace(drive, poses=drive.poses * (scale, scale, 1.0)) for drive in drives]
        text = f"x and y of the true poses are in {unit}, but must be in metres"
        found.append(Mistake(text, scaled, position_scale=scale))
    scales = {"the headings of the true poses are in degrees, but must be in rad": pi / 180}
    if _may_be_radians(drives):
        scales["the headings of the true poses are in rad, but must be in degrees"] = 180 / pi
    for text, scale in scales.items():
        scaled = [replace(drive, poses=drive.poses * (1.0, 1.0, scale)) for drive in drives]
        found.append(Mistake(text, scaled, heading_scale=scale))
    return found


def _may_be_radians(drives: Drives) -> bool:
    """Whether headings that were read as degrees may be in rad: none is above one turn.

    Otherwise this hypothesis would win wherever nothing explains the ends, by its Jacobian.
    """
    noted = [degrees(float(np.nanmax(np.abs(drive.poses[:, 2])))) for drive in drives]
    return max(noted) <= RADIANS_MAX


def _axis_scale_mistakes(drives: Drives) -> list[Mistake]:
    """x and y of the true poses measured with different scales."""
    found = []
    for scale in AXIS_SCALES:
        scaled = [replace(drive, poses=drive.poses * (scale, 1.0, 1.0)) for drive in drives]
        long, short = ("x", "y") if scale < 1.0 else ("y", "x")
        percent = 100 * abs(log(scale))
        text = (
            f"{long} of the true poses is about {percent:.0f} % too long, or {short} too short: "
            "measure both with the same tape"
        )
        found.append(Mistake(text, scaled, position_scale=sqrt(scale), is_axis_scale=True))
    return found


def _point_mistakes(drives: Drives) -> list[Mistake]:
    """True poses of another point of the robot than the middle of the axle, such as its nose.

    Measured from where that point stood at the start, or from where the axle stood. Only headings
    show it.
    """
    if not all(np.isfinite(drive.poses[:, 2]).all() for drive in drives):
        return []
    return [
        Mistake(
            f"the true poses are of a point {'ahead of' if ahead > 0.0 else 'behind'} the middle "
            f"of the axle (by about {100 * abs(ahead):.0f} cm): measure where that middle is",
            [_with_point(drive, ahead, starts_at_axle) for drive in drives],
        )
        for ahead in POINTS_AHEAD_M
        for starts_at_axle in (False, True)
    ]


def _with_point(drive: RecordedDrive, ahead: float, starts_at_axle: bool) -> RecordedDrive:
    """The poses of the axle, from those of a point `ahead` (m) of it."""
    headings = drive.poses[:, 2]
    offsets = np.stack([np.cos(headings), np.sin(headings), np.zeros(len(headings))], axis=1)
    if starts_at_axle:
        offsets[0] = 0.0
    return replace(drive, poses=drive.poses - ahead * offsets)


def _order_mistakes(drives: Drives) -> list[Mistake]:
    """True poses that belong to other drives."""
    if len(drives) < SHIFT_DRIVES_MIN or any(len(drive.rows) > 2 for drive in drives):
        return []
    numbers = list(range(len(drives)))
    orders = {
        "each end belongs to the drive before": numbers[1:] + numbers[:1],
        "each end belongs to the drive after": numbers[-1:] + numbers[:-1],
        "the ends are in the opposite order": numbers[::-1],
    }
    return [
        Mistake(
            f"{text}: is a line missing, or one too many?",
            [
                replace(drive, poses=drives[number].poses)
                for drive, number in zip(drives, order, strict=True)
            ],
        )
        for text, order in orders.items()
    ]


def _count_mistakes(drives: Drives) -> list[Mistake]:
    """Directions and units of the counts."""
    cases: list[tuple[str, tuple[float, float]]] = [
        ("the right encoder counts in the wrong direction", (-1.0, 1.0)),
        ("the left encoder counts in the wrong direction", (1.0, -1.0)),
        ("both encoders count in the wrong direction", (-1.0, -1.0)),
    ]
    for text, factor in TICK_FACTORS.items():
        fix = "per turn as the robot file states (`slots`)"
        cases.append((f"the wheels give {text} counts {fix}", (factor, factor)))
        cases.append((f"the right wheel gives {text} counts {fix}", (factor, 1.0)))
        cases.append((f"the left wheel gives {text} counts {fix}", (1.0, factor)))
    found = [
        Mistake(
            text,
            [replace(drive, turns=drive.turns * factors) for drive in drives],
            changes_counts=True,
        )
        for text, factors in cases
    ]
    summed = [replace(drive, turns=np.cumsum(drive.turns, axis=0)) for drive in drives]
    text = (
        "the columns of the counts hold the ticks of each row, but must hold counts since the start"
    )
    found.append(Mistake(text, summed, changes_counts=True))
    return found
