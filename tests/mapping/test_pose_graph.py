"""The pose graph against poses that are known."""

from itertools import pairwise

import numpy as np
import pytest

from diffbotctl.mapping.plane_pose import between, compose
from diffbotctl.mapping.pose_graph import KEPT_WEIGHT, PoseEdge, PoseGraph

SIGMA = np.array([0.03, 0.03, 0.01])


def ring(random, count=60, laps=3):
    """A drive of several laps around a square of 8 m, as truth and as a graph of noisy motions."""
    angle = 2 * np.pi * laps * np.arange(count) / count
    true = np.c_[4 * np.cos(angle), 4 * np.sin(angle), angle]
    graph = PoseGraph(true[0])
    for first, second in pairwise(true):
        graph.add_pose(between(first, second) + random.normal(0, 1, 3) * SIGMA, np.diag(SIGMA**2))
    return true, graph


def close(graph, true, random, pairs):
    for first, second in pairs:
        motion = between(true[first], true[second]) + random.normal(0, 1, 3) * SIGMA
        graph.add_edge(PoseEdge(first, second, motion, np.diag(SIGMA**2), True))


def position_errors(graph, true):
    return np.hypot(*(graph.poses - true)[:, :2].T)


@pytest.mark.parametrize("seed", range(4))
def test_closures_correct_the_drift_and_false_ones_have_no_influence(seed):
    random = np.random.default_rng(seed)
    true, graph = ring(random)
    before = position_errors(graph, true).mean()
    close(graph, true, random, [(i, i + 20) for i in range(0, 40, 2)])
    right = len(graph.edges)
    for _ in range(15):
        first, second = sorted(random.choice(60, 2, replace=False).tolist())
        wrong = np.array([*random.uniform(-5, 5, 2), random.uniform(-3, 3)])
        graph.add_edge(PoseEdge(first, second, wrong, np.diag(SIGMA**2), True))
    for _ in graph.solve():
        pass
    assert position_errors(graph, true).mean() < max(0.12, 0.5 * before)
    assert max(graph.weights[right:]) < KEPT_WEIGHT
    assert np.mean(np.array(graph.weights[59:right]) > KEPT_WEIGHT) > 0.9


def test_poses_may_be_added_while_it_is_solved():
    random = np.random.default_rng(1)
    true, graph = ring(random)
    close(graph, true, random, [(0, 20), (10, 30), (20, 40), (39, 59)])
    steps = graph.solve()
    next(steps)
    graph.add_pose(np.array([1.0, 0.0, 0.1]), np.diag(SIGMA**2))
    for _ in steps:
        pass
    assert between(graph.poses[-2], graph.poses[-1]) == pytest.approx([1.0, 0.0, 0.1])


def test_uncertainty_grows_along_the_drive_and_shrinks_by_a_closure():
    random = np.random.default_rng(2)
    true, graph = ring(random)
    open_loop = graph.paths(0)[0]
    assert (np.diff(open_loop[:, 0]) > 0).all()
    close(graph, true, random, [(0, 20), (20, 40)])
    closed = graph.paths(0)[0]
    assert closed[40, 0] < 0.1 * open_loop[40, 0]
    assert compose(true[0], between(true[0], true[5])) == pytest.approx(compose(true[5], [0, 0, 0]))
