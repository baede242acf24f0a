"""Mistakes in how ends and counts were noted, found by what would explain the measured ends.

Each mistake is a hypothesis: factors and an order of the columns that undo it. The hypothesis with
the highest posterior density wins; without a mistake is one of them. A change of units changes the
density of the same data by its Jacobian, so that small numbers do not look like good ones.

Two mistakes cannot be distinguished from a correct file in principle: counts of both wheels
exchanged are the same as ends mirrored; and without headings, x and y exchanged in squares look
like a wrong track taken for unequal wheels (UMBmark's two angles change places).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import log, pi, radians
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, RecordedDrive, Segment
from diffbotctl.calibrate.geometry_posterior import GeometryPrior, Solution, squared_error
from diffbotctl.calibrate.geometry_search import EndGrid

Drives = Sequence[RecordedDrive]
Cut = Callable[[Drives], tuple[list[Segment], Floats]]
"""From drives to their segments and the weights of these"""
# Logarithm of the density ratio from which a mistake is accepted: 1000 to 1. Few users make one.
MISTAKE_LOG_RATIO_MIN = 7.0
POLISH_LOG_RATIO_MIN = -12.0  # a hypothesis that is worse on the grid is not refined
USUAL_NOISE = (0.0007, 0.004, radians(2.0), radians(0.5))  # slip, position, heading, start
USUAL_CHI2_RATIO_MAX = 3.0  # for each of three coordinates
MISTAKE_MAXIMA = 2  # of the grid, refined for each mistake
RADIANS_MAX = 6.4  # of headings in rad that were wrapped, in rad
# Logarithm of the probability of another scale along an axis, to that of one scale for both.
OTHER_SCALE_LOG_PRIOR = -5.0


class Mistake(NamedTuple):
    """What is wrong, and what undoes it."""

    text: str
    poses: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """factors of x, y and heading, after the columns were put in order"""
    columns: tuple[int, int, int] = (0, 1, 2)
    counts: tuple[float, float] = (1.0, 1.0)
    """factors of the right and the left wheel"""

    def undone(self, drives: Drives) -> list[RecordedDrive]:
        """The drives without it."""
        return [
            replace(
                drive,
                poses=drive.poses[:, self.columns] * self.poses,
                turns=drive.turns * self.counts,
            )
            for drive in drives
        ]

    def log_jacobian(self, segments: Sequence[Segment], weights: Floats) -> float:
        """What it adds to the logarithm of the density of the noted ends."""
        known = np.array([bool(np.isfinite(segment.motion[2])) for segment in segments])
        x, y, heading = (log(abs(factor)) for factor in self.poses)
        return float((x + y) * weights.sum() + heading * weights[known].sum())


SWAPPED = (1, 0, 2)
EXCHANGED = "x and y of the true poses are exchanged{}: x is ahead, y to the left"
ENDS = (
    Mistake(EXCHANGED.format(""), columns=SWAPPED),
    Mistake(EXCHANGED.format(", and y has the wrong sign"), (1, -1, 1), SWAPPED),
    Mistake(EXCHANGED.format(", and x has the wrong sign"), (-1, 1, 1), SWAPPED),
    Mistake(
        "the true poses are mirrored (y is positive to the left, headings counter-clockwise), or "
        "the counts of the left and the right wheel are exchanged",
        (1, -1, -1),
    ),
    Mistake("y of the true poses has the wrong sign: it is positive to the left", (1, -1, 1)),
    Mistake("x of the true poses has the wrong sign: it is positive ahead", (-1, 1, 1)),
    Mistake(
        "the true poses are the start seen from the end: x and y have the wrong sign",
        (-1,) * 2 + (1,),
    ),
    Mistake(
        "the headings of the true poses have the wrong sign: counter-clockwise is positive",
        (1, 1, -1),
    ),
    *(
        Mistake(f"x and y of the true poses are in {unit}, but must be in metres", (size, size, 1))
        for unit, size in (
            ("millimetres", 0.001),
            ("centimetres", 0.01),
            ("inches", 0.0254),
            ("feet", 0.3048),
        )
    ),
    Mistake("the headings of the true poses are in degrees, but must be in rad", (1, 1, pi / 180)),
)
IN_RADIANS = Mistake(
    "the headings of the true poses are in rad, but must be in degrees", (1, 1, 180 / pi)
)
# Of x; a factor of both x and y means wheels of another size.
SCALES = tuple(
    Mistake(
        f"{'xy'[factor > 1]} of the true poses is about {100 * abs(log(factor)):.0f} % too long, "
        f"or {'yx'[factor > 1]} too short: measure both with the same tape",
        (factor, 1, 1),
    )
    for factor in (0.9, 0.94, 0.97, 1.03, 1.06, 1.1)
)
COUNTS = (
    *(
        Mistake(f"{what} in the wrong direction", counts=factors)
        for what, factors in (
            ("the right encoder counts", (-1, 1)),
            ("the left encoder counts", (1, -1)),
            ("both encoders count", (-1, -1)),
        )
    ),
    *(
        Mistake(f"{wheels} {many} counts per turn as the robot file states (`slots`)", counts=each)
        for many, factor in (
            ("half as many", 2.0),
            ("a quarter as many", 4.0),
            ("twice as many", 0.5),
            ("four times as many", 0.25),
        )
        for wheels, each in (
            ("the wheels give", (factor, factor)),
            ("the right wheel gives", (factor, 1.0)),
            ("the left wheel gives", (1.0, factor)),
        )
    ),
)


class Explanation(NamedTuple):
    """The most likely hypothesis."""

    mistake: Mistake | None
    plain: Solution
    """with the files as they are"""
    rival: Solution | None
    """the second-best geometry for the files as they are"""
    good_ratio: float
    """of the ends that the mistake explains, or the files as they are"""
    scaled: list[Solution]
    """with x and y of different scales, and scores for the files as they are"""

    def scale_covariance(self, prior: GeometryPrior) -> Floats:
        """(3, 3): of the logarithms of mean diameter, ratio and track, since an axis may have
        another scale than the other one."""
        logs = [each.score - self.plain.score + OTHER_SCALE_LOG_PRIOR for each in self.scaled]
        weights = np.exp(np.array([0.0, *logs]) - np.logaddexp.reduce([0.0, *logs]))[1:]
        middle = prior.offset(self.plain.geometry)
        changes = np.array([prior.offset(each.geometry) - middle for each in self.scaled])
        return np.asarray((changes.T * weights) @ changes) if len(changes) else np.zeros((3, 3))


def explain_ends(drives: Drives, prior: GeometryPrior, cut: Cut) -> Explanation:
    """Whether a mistake explains the ends much better than the files as they are."""
    segments, weights = cut(drives)
    grid = EndGrid(segments, prior)
    plain, *others = grid.solutions(segments, weights)
    limit = float(grid.scores(segments, weights).max()) + POLISH_LOG_RATIO_MIN
    mistakes = [*ENDS, *SCALES]
    # Else this hypothesis wins by its Jacobian wherever nothing explains the ends.
    if max(float(np.nanmax(np.abs(drive.poses[:, 2]))) for drive in drives) <= radians(RADIANS_MAX):
        mistakes.append(IN_RADIANS)
    if not _is_usual(segments, weights, plain):
        mistakes += COUNTS
    best_score, mistake, good = plain.score + MISTAKE_LOG_RATIO_MIN, None, plain.good
    good_weights, scaled = weights, []
    for each in mistakes:
        segments, weights = cut(each.undone(drives))
        own_grid = EndGrid(segments, prior) if each in COUNTS else grid
        offset = each.log_jacobian(segments, weights)
        if float(own_grid.scores(segments, weights).max()) + offset < limit:
            continue
        solution = own_grid.solutions(segments, weights, MISTAKE_MAXIMA)[0]
        solution = replace(solution, score=solution.score + offset)
        if each in SCALES:
            scaled.append(solution)
        if solution.score > best_score:
            best_score, mistake, good, good_weights = solution.score, each, solution.good, weights
    good_ratio = float(np.average(good, weights=good_weights))
    return Explanation(mistake, plain, others[0] if others else None, good_ratio, scaled)


def _is_usual(segments: Sequence[Segment], weights: Floats, plain: Solution) -> bool:
    """Whether the ends are as near as those of careful measurements: wrong counts are not."""
    if plain.good.min() < 0.5:
        return False
    chi2 = squared_error(segments, weights, plain.geometry, USUAL_NOISE)
    return chi2 < USUAL_CHI2_RATIO_MAX * 3 * float(weights.sum())
