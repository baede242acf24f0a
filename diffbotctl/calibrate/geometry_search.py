"""Search for the geometries near the stated one that may explain the ends of drives.

A heading is known modulo one turn, so the ends of long drives have several solutions, and
Gauss-Newton iterations find the one that is next to their start. So the posterior is first
evaluated on a grid of tracks and wheel ratios that is finer than one such solution is wide, and its
highest maxima are the starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, log, pi

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.dead_reckoning import (
    Floats,
    Geometry,
    Segment,
    end_positions,
    merged_steps,
)
from diffbotctl.calibrate.end_noise import SEARCH_NOISE
from diffbotctl.calibrate.geometry_posterior import (
    BAD_PROBABILITY,
    GeometryPrior,
    Solution,
    log_wrong_density,
    solve,
)

TRACK_LOG_MAX = log(1.4)  # a track measured at the inner or outer edges of the tyres
RATIO_LOG_MAX = log(1.1)
NODE_HEADING_RAD = 0.3  # change of the heading of an end from one node of the grid to the next
NODES_MAX = (31, 81)  # of track and ratio
STEPS_MAX = 120  # of a segment
HEADING_SD_RAD = 0.2  # of an end, within a node
POSITION_SD_RATIO = 0.08  # of the distance rolled
POSITION_SD_M = 0.02
MAXIMA = 4  # of the grid, refined


class EndGrid:
    """Dead-reckoned ends of segments on a grid of tracks and wheel ratios."""

    def __init__(self, segments: Sequence[Segment], prior: GeometryPrior) -> None:
        stated = prior.stated
        turned, arc = 1.0, 1.0
        for segment in segments:
            rolled = segment.rolled * (stated.right, stated.left)
            headings = np.cumsum(rolled[:, 0] - rolled[:, 1]) / stated.track
            turned = max(turned, float(np.abs(headings).max()))
            arc = max(arc, float(np.abs(rolled).sum(axis=0).max()) / stated.track)
        tracks = _nodes(TRACK_LOG_MAX, NODE_HEADING_RAD / turned, NODES_MAX[0])
        ratios = _nodes(RATIO_LOG_MAX, NODE_HEADING_RAD / arc, NODES_MAX[1])
        self.prior = prior
        self.shape = len(tracks), len(ratios)
        self.geometries = np.array(
            [
                stated.reshaped(stated.ratio * ratio, stated.track * track)
                for track in tracks
                for ratio in ratios
            ]
        )
        self.ends = [
            end_positions(merged_steps(segment.rolled, STEPS_MAX), self.geometries)
            for segment in segments
        ]
        logs = np.log(
            np.array([self.geometries[:, 0] / self.geometries[:, 1], self.geometries[:, 2]])
        )
        offsets = logs - np.log([[stated.ratio], [stated.track]])
        self._prior_scores = -0.5 * (offsets**2 / np.square(prior.sds[1:])[:, None]).sum(axis=0)

    def scores(self, segments: Sequence[Segment], weights: Floats) -> Floats:
        """(tracks, ratios): logarithms of the densities of `segments`, which have the same counts
        as those of the grid."""
        scores = self._prior_scores.copy()
        stated = self.prior.stated
        wrong = log_wrong_density(segments, stated)
        for segment, ends, weight, bad in zip(segments, self.ends, weights, wrong, strict=True):
            good = _log_densities(ends, segment, stated)
            mixture = np.logaddexp(log(1 - BAD_PROBABILITY) + good, log(BAD_PROBABILITY) + bad)
            scores += weight * mixture
        return np.asarray(scores.reshape(self.shape))

    def solutions(
        self, segments: Sequence[Segment], weights: Floats, maxima: int = MAXIMA
    ) -> list[Solution]:
        """The most likely geometries, best first; those that agree are returned once."""
        solutions: list[Solution] = []
        for row, column in _maxima(self.scores(segments, weights))[:maxima]:
            start = Geometry(*self.geometries[row * self.shape[1] + column])
            solution = solve(segments, weights, start, self.prior, SEARCH_NOISE)
            if not any(_agree(solution, other) for other in solutions):
                solutions.append(solution)
        return sorted(solutions, key=lambda solution: -solution.score)


def _agree(one: Solution, other: Solution) -> bool:
    lengths = zip(one.geometry, other.geometry, strict=True)
    return max(abs(log(first / second)) for first, second in lengths) < 1e-3


def _nodes(limit: float, step: float, count_max: int) -> Floats:
    count = min(2 * ceil(limit / step) + 1, count_max)
    return np.asarray(np.exp(np.linspace(-limit, limit, count)))


def _log_densities(ends: Floats, segment: Segment, stated: Geometry) -> Floats:
    """(geometries,): of the measured end of a segment, with the noise of the search."""
    errors = ends - segment.motion
    rolled = float(np.abs(segment.rolled).sum(axis=0).max()) * stated.mean
    sd = POSITION_SD_M + POSITION_SD_RATIO * rolled
    density = -0.5 * (errors[:, :2] ** 2).sum(axis=1) / sd**2 - log(2 * pi * sd**2)
    if np.isfinite(segment.motion[2]):
        heading = (errors[:, 2] + pi) % (2 * pi) - pi
        density += -0.5 * (heading / HEADING_SD_RAD) ** 2 - log(HEADING_SD_RAD * (2 * pi) ** 0.5)
    return np.asarray(density)


def _maxima(scores: Floats) -> list[tuple[int, int]]:
    """The local maxima of a grid, highest first."""
    padded = np.pad(scores, 1, constant_values=-np.inf)
    rows, columns = scores.shape
    neighbours = [
        padded[1 + down : 1 + down + rows, 1 + right : 1 + right + columns]
        for down in (-1, 0, 1)
        for right in (-1, 0, 1)
    ]
    places: NDArray[np.intp] = np.argwhere(scores >= np.max(neighbours, axis=0))
    order = np.argsort([-scores[row, column] for row, column in places])
    return [(int(row), int(column)) for row, column in places[order]]
