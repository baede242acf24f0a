"""Poses, what is known of the motion between pairs of them, and the poses that fit all of it best.

Gauss-Newton on the manifold (Grisetti et al. 2010, "A tutorial on graph-based SLAM"). Closures may
be wrong: they have Geman-McClure weights whose scale falls from wide to narrow (graduated
non-convexity, Yang et al. 2020), so that a closure which contradicts the others has no influence.
"""

from __future__ import annotations

from collections.abc import Generator
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from diffbotctl.mapping.plane_pose import Array, between, compose, wrapped

KERNEL_SCALE = 9.0  # squared deviations (chi squared with 3 degrees of freedom: 97 %)
KERNEL_START, KERNEL_FALL = 100.0, 0.4  # first scale, in KERNEL_SCALE; ratio of the next one
ITERATIONS = 12
KEPT_WEIGHT = 0.1  # a closure with less was rejected
FIXED = 1e9  # information on the first pose, which stays
HEADING_ARM = 4.0  # m2 a rad2, to compare uncertainties of heading and position


class PoseEdge(NamedTuple):
    """A motion between two poses."""

    first: int
    second: int
    motion: Array
    """pose of `second` in the frame of `first`"""
    covariance: Array
    """3 x 3, x and y along the axes of `first`"""
    is_closure: bool


class PoseGraph:
    """Poses in map; the first one is fixed."""

    def __init__(self, first: Array) -> None:
        self.poses = np.array(first, float).reshape(1, 3)
        self.edges: list[PoseEdge] = []
        self.weights: list[float] = []
        """of each edge, 0 to 1, from the last solution"""

    def add_pose(self, motion: Array, covariance: Array) -> int:
        """The next pose, `motion` after the last one. Returns its index."""
        last = len(self.poses) - 1
        self.poses = np.vstack([self.poses, compose(self.poses[last], motion)])
        self.add_edge(PoseEdge(last, last + 1, motion, covariance, False))
        return last + 1

    def add_edge(self, edge: PoseEdge) -> None:
        """A further motion between two poses."""
        self.edges.append(edge)
        self.weights.append(1.0)

    def solve(self) -> Generator[None]:
        """Move the poses; one iteration a step. Poses and edges may be added meanwhile."""
        poses, edges = self.poses.copy(), list(self.edges)
        weights = np.ones(len(edges))
        for iteration in range(ITERATIONS):
            scale = KERNEL_SCALE * max(1.0, KERNEL_START * KERNEL_FALL**iteration)
            poses, weights = _iterated(poses, edges, scale)
            yield
        last = len(poses) - 1
        later = between(self.poses[last], self.poses[last + 1 :])
        self.poses = np.vstack([poses, compose(poses[last], later)])
        self.weights[: len(edges)] = weights.tolist()

    def paths(self, source: int) -> tuple[Array, list[int]]:
        """Uncertainty of each pose relative to `source` along the least uncertain way.

        Returns variances of position (m2) and heading (rad2), N x 2, and the edge by which each
        pose was reached (-1: none). An upper bound: other ways only reduce it.
        """
        neighbours: list[list[tuple[int, int, float, float, float]]] = [[] for _ in self.poses]
        for index, (edge, weight) in enumerate(zip(self.edges, self.weights, strict=True)):
            if weight >= KEPT_WEIGHT:
                covariance = edge.covariance
                position = 0.5 * float(covariance[0, 0] + covariance[1, 1])
                length = float(edge.motion[0] ** 2 + edge.motion[1] ** 2)
                step = (index, position, float(covariance[2, 2]), length)
                neighbours[edge.first].append((edge.second, *step))
                neighbours[edge.second].append((edge.first, *step))
        found = np.full((len(self.poses), 2), np.inf)
        reached = [-1] * len(self.poses)
        waiting: list[tuple[float, int, float, float, int]] = [(0.0, source, 0.0, 0.0, -1)]
        while waiting:
            _, node, position, heading, by = heappop(waiting)
            if found[node, 0] < np.inf:
                continue
            found[node] = position, heading
            reached[node] = by
            for other, index, more, turn, length in neighbours[node]:
                further = position + more + heading * length
                cost = further + HEADING_ARM * (heading + turn)
                heappush(waiting, (cost, other, further, heading + turn, index))
        return found, reached


def _iterated(poses: Array, edges: list[PoseEdge], scale: float) -> tuple[Array, Array]:
    """Poses after one Gauss-Newton step, and the weight of each edge before it."""
    count = len(poses)
    first = np.array([edge.first for edge in edges], int)
    second = np.array([edge.second for edge in edges], int)
    motion = np.array([edge.motion for edge in edges]).reshape(-1, 3)
    information = np.linalg.inv(np.array([edge.covariance for edge in edges]).reshape(-1, 3, 3))
    robust = np.array([edge.is_closure for edge in edges], bool)
    seen = between(poses[first], poses[second])
    residual = seen - motion
    residual[:, 2] = wrapped(residual[:, 2])
    cosine, sine = np.cos(poses[first, 2]), np.sin(poses[first, 2])
    start, end = np.zeros((2, len(edges), 3, 3))
    end[:, 0, 0], end[:, 0, 1], end[:, 1, 0], end[:, 1, 1] = cosine, sine, -sine, cosine
    start[:, :2, :2] = -end[:, :2, :2]
    start[:, 0, 2], start[:, 1, 2] = seen[:, 1], -seen[:, 0]
    end[:, 2, 2], start[:, 2, 2] = 1.0, -1.0
    squared = np.einsum("ni,nij,nj->n", residual, information, residual)
    weights = np.where(robust, (scale / (scale + squared)) ** 2, 1.0)
    information = information * weights[:, None, None]
    from_start = np.swapaxes(start, 1, 2) @ information
    from_end = np.swapaxes(end, 1, 2) @ information
    hessian = np.zeros((count, count, 3, 3))
    np.add.at(hessian, (first, first), from_start @ start)
    np.add.at(hessian, (first, second), from_start @ end)
    np.add.at(hessian, (second, first), from_end @ start)
    np.add.at(hessian, (second, second), from_end @ end)
    gradient = np.zeros((count, 3))
    np.add.at(gradient, first, np.einsum("nij,nj->ni", from_start, residual))
    np.add.at(gradient, second, np.einsum("nij,nj->ni", from_end, residual))
    flat = hessian.transpose(0, 2, 1, 3).reshape(3 * count, 3 * count)
    flat[np.diag_indices(3)] += FIXED
    moved = poses - np.linalg.solve(flat, gradient.reshape(-1)).reshape(-1, 3)
    moved[:, 2] = wrapped(moved[:, 2])
    return moved, weights
