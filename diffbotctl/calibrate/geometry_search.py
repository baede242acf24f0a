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

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry, Segment, merged_steps
from diffbotctl.calibrate.end_noise import SEARCH_NOISE
from diffbotctl.calibrate.geometry_posterior import (
    RECORDED,
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
SAME_RATIO_MAX = 1e-3  # between two solutions that are one


def search(segments: Sequence[Segment], weights: Floats, prior: GeometryPrior) -> list[Solution]:
    """The most likely geometries, best first; those that agree are returned once."""
    stated = prior.stated
    turned = max(
        1.0,
        *(
            float(np.abs(np.cumsum(each[:, 0] - each[:, 1])).max()) * stated.mean / stated.track
            for each in (segment.rolled for segment in segments)
        ),
    )
    arc = max(1.0, *(_distance(segment, stated) / stated.track for segment in segments))
    tracks = _nodes(TRACK_LOG_MAX, NODE_HEADING_RAD / turned, NODES_MAX[0])
    ratios = _nodes(RATIO_LOG_MAX, NODE_HEADING_RAD / arc, NODES_MAX[1])
    nodes = [
        stated.reshaped(stated.ratio * ratio, stated.track * track)
        for track in tracks
        for ratio in ratios
    ]
    scores = np.array([prior.log_density(node) for node in nodes])
    wrong = log_wrong_density(segments, stated, RECORDED)
    right = log(1 - RECORDED.probability)
    for segment, weight, bad in zip(segments, weights, wrong, strict=True):
        good = _log_densities(segment, np.array(nodes), stated)
        scores += weight * np.logaddexp(right + good, bad)
    solutions: list[Solution] = []
    for place in _maxima(scores.reshape(len(tracks), len(ratios)))[:MAXIMA]:
        solution = solve(segments, weights, nodes[place], prior, SEARCH_NOISE)
        if not any(are_near(solution, other, SAME_RATIO_MAX) for other in solutions):
            solutions.append(solution)
    return sorted(solutions, key=lambda solution: -solution.score)


def are_near(one: Solution, other: Solution, limit: float) -> bool:
    """Whether all lengths of both differ by less than `limit` (relative)."""
    lengths = zip(one.geometry, other.geometry, strict=True)
    return max(abs(log(first / second)) for first, second in lengths) < limit


def _nodes(limit: float, step: float, count_max: int) -> Floats:
    count = min(2 * ceil(limit / step) + 1, count_max)
    return np.asarray(np.exp(np.linspace(-limit, limit, count)))


def _distance(segment: Segment, geometry: Geometry) -> float:
    """How far (m) the wheel that rolled further has rolled."""
    return float(np.abs(segment.rolled).sum(axis=0).max()) * geometry.mean


def _log_densities(segment: Segment, nodes: Floats, stated: Geometry) -> Floats:
    """(nodes,): of the measured end of a segment, with the noise of the search."""
    errors = end_positions(merged_steps(segment.rolled, STEPS_MAX), nodes) - segment.motion
    sd = POSITION_SD_M + POSITION_SD_RATIO * _distance(segment, stated)
    density = -0.5 * (errors[:, :2] ** 2).sum(axis=1) / sd**2 - log(2 * pi * sd**2)
    if np.isfinite(segment.motion[2]):
        heading = (errors[:, 2] + pi) % (2 * pi) - pi
        density += -0.5 * (heading / HEADING_SD_RAD) ** 2 - log(HEADING_SD_RAD * (2 * pi) ** 0.5)
    return np.asarray(density)


def _maxima(scores: Floats) -> list[int]:
    """The local maxima of a grid, highest first, in the order of its nodes."""
    padded = np.pad(scores, 1, constant_values=-np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    places = np.flatnonzero(scores >= windows.max(axis=(2, 3)))
    return sorted(places.tolist(), key=lambda place: -scores.flat[place])


def end_positions(rolled: Floats, geometries: Floats) -> Floats:
    """The ends (geometries, 3) of steps (steps, 2: turns times pi of the right and left wheel).

    `geometries` (geometries, 3): right and left diameter, track, in m.
    """
    # Single precision suffices for a search, and is several times faster.
    steps = rolled.astype(np.float32)
    right, left = (
        np.outer(geometries[:, wheel].astype(np.float32), steps[:, wheel]) for wheel in (0, 1)
    )
    turned = (right - left) / geometries[:, 2:].astype(np.float32)
    headings = np.cumsum(turned, axis=1)
    middle = headings - turned / 2
    chord = (right + left) * (0.5 - turned * turned / 48)  # the sine of a small angle
    x, y = (chord * np.cos(middle)).sum(axis=1), (chord * np.sin(middle)).sum(axis=1)
    return np.stack([x, y, headings[:, -1]], axis=1).astype(float)
