"""Earlier submaps that a finished submap sees again: motions for the pose graph."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from diffbotctl.mapping.branch_and_bound import Window, best_pose
from diffbotctl.mapping.plane_pose import Array, between, compose, inverse
from diffbotctl.mapping.pose_graph import PoseEdge
from diffbotctl.mapping.scan_match import refine
from diffbotctl.mapping.submaps import Submaps

QUERIES = slice(2, -1, 3)  # of the keyframes of a submap
TARGETS_MAX = 3  # earlier submaps for each query
NEAR = 3.0  # m, from the middle of a submap, beside the uncertainty
SCORE_MIN = 0.62
OVERLAP_MIN = 0.4
REACH_MAX, TURN_MAX = 6.0, 0.5  # m, rad, of the search
REACH_MORE, TURN_MORE = 0.3, 0.05  # m, rad, beside three sigma
WEAK_PRIOR = 0.1 * np.eye(3)
CLOSURE_SIGMA = (0.03, 0.008)  # m, rad: submaps are not rigid
ARM_SIGMA = 0.006  # rad, times the distance of the scan from the submap's origin


def close(submaps: Submaps, submap: int) -> Generator[None, None, int]:
    """Search `submap` in earlier ones and add what is found. Returns how many motions."""
    members = submaps.members(submap)
    variances = submaps.graph.paths(submap)[0]
    yield
    added = 0
    for index in members[QUERIES]:
        points = submaps.query(index)
        for target, window in _targets(submaps, submap, index, variances):
            edge = yield from _closure(submaps, index, target, points, window)
            if edge is not None:
                submaps.graph.add_edge(edge)
                added += 1
            yield
    return added


def _targets(
    submaps: Submaps, submap: int, index: int, variances: Array
) -> list[tuple[int, Window]]:
    """Earlier submaps near keyframe `index`, the most likely ones first, and where to search."""
    here = submaps.pose(index)
    middles = np.zeros((len(submaps.graph.poses), 2))
    counts = np.zeros(len(middles))
    for each in submaps.keyframes:
        middles[each.submap] += each.local[:2]
        counts[each.submap] += 1
    middles /= np.maximum(counts, 1)[:, None]
    seen = between(submaps.graph.poses, here)
    distance = np.hypot(*(seen[:, :2] - middles).T)
    turn = 3 * np.sqrt(variances[:, 1])
    reach = 3 * np.sqrt(variances[:, 0])
    near = [i for i in range(submap - 2) if distance[i] < NEAR + reach[i]]
    near.sort(key=lambda i: distance[i] - reach[i])
    return [
        (
            i,
            Window(
                seen[i], min(reach[i] + REACH_MORE, REACH_MAX), min(turn[i] + TURN_MORE, TURN_MAX)
            ),
        )
        for i in near[:TARGETS_MAX]
    ]


def _closure(
    submaps: Submaps, index: int, target: int, points: Array, window: Window
) -> Generator[None, None, PoseEdge | None]:
    field = submaps.field(target)
    peak = yield from best_pose(field, points, window, SCORE_MIN)
    if peak is None:
        return None
    keyframe = submaps.keyframes[index]
    fit = refine(field, keyframe.surface, peak.pose, peak.pose, WEAK_PRIOR)
    if fit.overlap < OVERLAP_MIN:
        return None
    covariance = np.linalg.inv(fit.information + np.linalg.inv(WEAK_PRIOR))
    position, heading = CLOSURE_SIGMA
    position = float(np.hypot(position, ARM_SIGMA * np.hypot(*keyframe.local[:2])))
    covariance += np.diag([position**2, position**2, heading**2])
    motion = compose(fit.pose, inverse(keyframe.local))
    return PoseEdge(target, keyframe.submap, motion, covariance, True)
