"""The kept scans, in groups whose scans do not move against each other, and their pose graph."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diffbotctl.mapping.lidar_scan import MappedScan, SurfacePoints, surface_points
from diffbotctl.mapping.match_field import MatchField, joined
from diffbotctl.mapping.plane_pose import Array, between, compose, rotated_covariance, transformed
from diffbotctl.mapping.pose_graph import PoseEdge, PoseGraph

SUBMAP_SCANS = 10
SUBMAPS_MAX = 128  # then they are halved: 256 m of new places at 0.2 m a keyframe
FIELDS_MAX = 4  # kept; each takes up to 3 MB
QUERY_SIDE = 2  # keyframes before and after, whose points are searched together
QUERY_CELL = 0.10  # m; one point a cell
QUERY_REACH = 10.0  # m
QUERY_POINTS = 300


class Keyframe(NamedTuple):
    """A scan that is kept."""

    scan: MappedScan
    """its points in single precision, as in a file"""
    submap: int
    local: Array
    """pose in the frame of the submap, which is that of its first keyframe"""

    @property
    def surface(self) -> SurfacePoints:
        """Its points and their surfaces; computed each time, so that they take no memory."""
        return surface_points(self.scan.points, self.scan.origin)


class Submaps:
    """Keyframes, and the pose of each submap in map."""

    def __init__(self, first: Array) -> None:
        """`first`: the pose of the first submap in map."""
        self.keyframes: list[Keyframe] = []
        self.graph = PoseGraph(first)
        self._fields: dict[int, MatchField] = {}

    @property
    def newest(self) -> int:
        """The submap that is being filled."""
        return len(self.graph.poses) - 1

    def add(self, scan: MappedScan, local: Array) -> None:
        """Keep a scan in the newest submap."""
        kept = scan._replace(
            points=scan.points.astype(np.float32), clear=scan.clear.astype(np.float32)
        )
        self.keyframes.append(Keyframe(kept, self.newest, local))

    def begin(self, motion: Array, covariance: Array) -> None:
        """A new submap, `motion` after the newest one; `covariance`: in the frame after it."""
        self.graph.add_pose(motion, rotated_covariance(covariance, float(motion[2])))

    def members(self, submap: int) -> list[int]:
        """Indices of the keyframes of a submap."""
        return [i for i, each in enumerate(self.keyframes) if each.submap == submap]

    def pose(self, index: int) -> Array:
        """Of a keyframe in map."""
        keyframe = self.keyframes[index]
        return compose(self.graph.poses[keyframe.submap], keyframe.local)

    def poses(self) -> Array:
        """N x 3: of all keyframes in map."""
        owner = np.array([each.submap for each in self.keyframes], int)
        local = np.array([each.local for each in self.keyframes]).reshape(-1, 3)
        return compose(self.graph.poses[owner], local)

    def field(self, submap: int) -> MatchField:
        """Of a submap that is complete, in its frame."""
        if submap not in self._fields:
            members = [self.keyframes[i] for i in self.members(submap)]
            surfaces = [each.surface for each in members]
            if len(self._fields) >= FIELDS_MAX:
                del self._fields[next(iter(self._fields))]
            self._fields[submap] = MatchField(
                joined(surfaces, np.array([each.local for each in members]))
            )
        return self._fields[submap]

    def query(self, index: int) -> Array:
        """N x 2: points around keyframe `index`, in its frame, evenly thinned."""
        low, high = max(0, index - QUERY_SIDE), min(len(self.keyframes), index + QUERY_SIDE + 1)
        here = self.pose(index)
        points = np.vstack(
            [
                transformed(self.keyframes[i].scan.points, between(here, self.pose(i)))
                for i in range(low, high)
            ]
        )
        return thinned(points[np.hypot(*points.T) < QUERY_REACH])

    def halve(self) -> None:
        """Join pairs of submaps and keep every second keyframe of them, and one closure of a pair.

        Bounds memory and the time of a solution, whatever the length of a drive.
        """
        poses, graph = self.graph.poses, self.graph
        parent = np.arange(len(poses)) // 2
        change = between(poses[2 * parent], poses)
        keyframes = [
            each._replace(
                submap=int(parent[each.submap]), local=compose(change[each.submap], each.local)
            )
            for i, each in enumerate(self.keyframes)
            if i % 2 == 0
        ]
        halved = PoseGraph(poses[0])
        halved.poses = poses[::2].copy()
        closed: set[tuple[int, int]] = set()
        for index in np.argsort(-np.array(graph.weights), kind="stable").tolist():
            edge, weight = graph.edges[index], graph.weights[index]
            first, second = int(parent[edge.first]), int(parent[edge.second])
            if first != second and not (edge.is_closure and (first, second) in closed):
                if edge.is_closure:
                    closed.add((first, second))
                before, after = change[edge.first], change[edge.second]
                motion = compose(compose(before, edge.motion), between(after, np.zeros(3)))
                covariance = rotated_covariance(edge.covariance, float(before[2]))
                halved.add_edge(PoseEdge(first, second, motion, covariance, edge.is_closure))
                halved.weights[-1] = weight
        self.keyframes, self.graph = keyframes, halved
        self._fields.clear()


def thinned(points: Array) -> Array:
    """At most one point in each cell of QUERY_CELL, and at most QUERY_POINTS of them."""
    if not len(points):
        return points
    cells = np.floor(points / QUERY_CELL).astype(np.int64)
    first = np.unique(cells[:, 0] * 1_000_003 + cells[:, 1], return_index=True)[1]
    kept: Array = points[np.sort(first)]
    return kept[:: -(-len(kept) // QUERY_POINTS)]
