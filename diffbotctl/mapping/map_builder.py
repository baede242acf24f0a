"""A map that grows: keyframes, submaps, loop closures and the grid, in steps of bounded size."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator

import numpy as np

from diffbotctl.mapping.lidar_scan import MappedScan, SurfacePoints, surface_points
from diffbotctl.mapping.loop_closure import close
from diffbotctl.mapping.match_field import MatchField, joined
from diffbotctl.mapping.occupancy_grid import GridBuilder
from diffbotctl.mapping.plane_pose import Array, between, compose, moved_covariance
from diffbotctl.mapping.scan_map import Map
from diffbotctl.mapping.scan_tracker import FLOOR
from diffbotctl.mapping.submaps import SUBMAP_SCANS, SUBMAPS_MAX, Submaps

REFERENCE_SCANS = 80  # the last keyframes, which a scan is matched with
DRAWN_SCANS = 4  # of a grid that is drawn again, in one step
MOVED = 0.5  # cells; when a submap moved further, the grid is drawn again,
DRAWN_SHARE = 20  # and at most this often for each keyframe
JUMP = np.diag([0.05, 0.05, 0.02]) ** 2  # of a pose where the robot was found again
DRIFT = (0.005, 0.02, 0.002, 0.006, 0.01)  # m; m a metre; rad; rad a metre; rad a rad


class MapBuilder:
    """Keeps scans and corrects their poses. `tracking`: the frame that is never corrected."""

    def __init__(self, resolution: float, first: Array) -> None:
        """`first`: the first pose, in map and in tracking alike."""
        self.submaps = Submaps(first)
        self.redrawn: GridBuilder | None = None
        """the grid after loops were closed; whoever takes it sets it to None"""
        self._resolution = resolution
        self._anchor = np.array(first, float)  # of the newest submap, in tracking
        self._last = np.array(first, float)  # keyframe, in tracking
        self._since_anchor = np.zeros((3, 3))  # covariance, in the frame of the last keyframe
        self._recent: deque[tuple[SurfacePoints, Array]] = deque(maxlen=REFERENCE_SCANS)
        self._finished: deque[int] = deque()
        self._work: Generator[None] | None = None
        self._drawn = self.submaps.graph.poses.copy()
        self._count = 0
        self._keyframes_drawn = 0
        self._anchor_covariance = np.zeros((3, 3))
        self.field: MatchField | None = None
        """around the last keyframes, in tracking"""

    def motion(self, tracked: Array) -> Array:
        """From the last keyframe to a pose in tracking."""
        return between(self._last, tracked)

    def in_map(self, tracked: Array) -> Array:
        """A pose in tracking, in map."""
        return compose(self.submaps.graph.poses[-1], between(self._anchor, tracked))

    def covariance(self, tracked: Array, tracking: Array) -> Array:
        """Of a pose in map, in its frame; `tracking`: relative to the last keyframe."""
        anchored = moved_covariance(self._anchor_covariance, between(self._anchor, tracked))
        return anchored + moved_covariance(self._since_anchor, self.motion(tracked)) + tracking

    def add(
        self, scan: MappedScan, surface: SurfacePoints, tracked: Array, covariance: Array
    ) -> None:
        """Keep a scan; `covariance`: of its pose relative to the keyframe before."""
        self.keep(scan, surface, tracked, covariance)
        surfaces = [each for each, _ in self._recent]
        self.field = MatchField(joined(surfaces, np.array([pose for _, pose in self._recent])))

    def keep(
        self, scan: MappedScan, surface: SurfacePoints, tracked: Array, covariance: Array
    ) -> None:
        """`add` without the field, for scans of which none is matched before `jump`."""
        motion = between(self._last, tracked)
        distance, turn = float(np.hypot(motion[0], motion[1])), abs(float(motion[2]))
        position = DRIFT[0] + DRIFT[1] * distance
        heading = DRIFT[2] + DRIFT[3] * distance + DRIFT[4] * turn
        drift = np.diag([position**2, position**2, heading**2])
        self._since_anchor = moved_covariance(self._since_anchor, motion) + covariance + drift
        if self._count == SUBMAP_SCANS:
            self._finished.append(self.submaps.newest)
            motion = between(self._anchor, tracked)
            self.submaps.begin(motion, self._since_anchor)
            self._anchor_covariance = (
                moved_covariance(self._anchor_covariance, motion) + self._since_anchor
            )
            self._drawn = np.vstack([self._drawn, self.submaps.graph.poses[-1:]])
            self._anchor, self._since_anchor = tracked.copy(), np.zeros((3, 3))
            self._count = 0
        self._count += 1
        self._last = tracked.copy()
        self.submaps.add(scan, between(self._anchor, tracked))
        self._recent.append((surface, tracked.copy()))

    def jump(self, pose: Array) -> Array:
        """Go on at another `pose` in map. Returns it in tracking."""
        submaps = self.submaps
        tracked = compose(self._anchor, between(submaps.graph.poses[-1], pose))
        poses = submaps.poses()
        order = np.argsort(np.hypot(*(poses - pose)[:, :2].T), kind="stable")[:REFERENCE_SCANS]
        in_tracking = compose(tracked, between(pose, poses[order]))
        surfaces = [submaps.keyframes[i].surface for i in order]
        self._recent = deque(zip(surfaces, in_tracking, strict=True), maxlen=REFERENCE_SCANS)
        self.field = MatchField(joined(surfaces, in_tracking))
        self._last = tracked
        self._since_anchor = JUMP.copy()
        self._count = SUBMAP_SCANS
        return tracked

    def step(self) -> bool:
        """Do a part of the waiting work. Returns whether there was any."""
        if self._work is None:
            if not self._finished:
                return False
            if len(self.submaps.graph.poses) >= SUBMAPS_MAX:
                self._halve()
            self._work = self._revise(self._finished.popleft())
        if next(self._work, "end") == "end":
            self._work = None
        return True

    def _halve(self) -> None:
        newest = self.submaps.newest
        parent = self.submaps.graph.poses[newest - newest % 2]
        inside = between(self.submaps.graph.poses[newest], parent)
        self._anchor = compose(self._anchor, inside)
        self.submaps.halve()
        self._finished = deque([(newest - 1) // 2])
        self._drawn = self.submaps.graph.poses.copy()

    def _revise(self, submap: int) -> Generator[None]:
        """Close loops of a finished submap, then solve the graph and draw the map again."""
        graph = self.submaps.graph
        added = yield from close(self.submaps, submap)
        if not added:
            return
        yield from graph.solve()
        position, heading = graph.paths(0)[0][-1]
        self._anchor_covariance = np.diag([position, position, heading])
        moved = np.hypot(*(graph.poses[: len(self._drawn)] - self._drawn)[:, :2].T).max()
        since = len(self.submaps.keyframes) - self._keyframes_drawn
        is_due = DRAWN_SHARE * since >= len(self.submaps.keyframes)
        if is_due and moved > MOVED * self._resolution:
            yield from self._redraw()

    def _redraw(self) -> Generator[None]:
        drawn = self.submaps.graph.poses.copy()
        builder = GridBuilder(self._resolution)
        index = 0
        while index < len(self.submaps.keyframes):
            for i in range(index, min(index + DRAWN_SCANS, len(self.submaps.keyframes))):
                builder.insert(self.submaps.keyframes[i].scan, self.submaps.pose(i))
            index += DRAWN_SCANS
            yield
        self.redrawn = builder
        self._keyframes_drawn = len(self.submaps.keyframes)
        self._drawn = np.vstack([drawn, self.submaps.graph.poses[len(drawn) :]])


def resumed(resolution: float, saved: Map) -> MapBuilder:
    """A builder that goes on with a saved map, after `jump` to the pose in it."""
    builder = MapBuilder(resolution, saved.poses[0])
    for scan, pose in zip(saved.scans, saved.poses, strict=True):
        builder.keep(scan, surface_points(scan.points, scan.origin), pose, FLOOR)
    return builder
