"""Where the robot is in the map, and the map itself, from scans and odometry.

The pose in odom is never changed: what comes back is the pose of odom in map (REP-105).
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import numpy as np

from diffbotctl.mapping.lidar_scan import MappedScan, SurfacePoints, surface_points
from diffbotctl.mapping.map_builder import MapBuilder
from diffbotctl.mapping.occupancy_grid import GridBuilder, OccupancyGrid
from diffbotctl.mapping.plane_pose import Array, compose, inverse, rotated_covariance
from diffbotctl.mapping.scan_map import Map
from diffbotctl.mapping.scan_tracker import FLOOR, ScanTracker

STEP_PERIOD = 0.05  # s, of the time from scan to scan, for one step of the waiting work
STEPS_MAX = 60  # for one scan


class MapperState(StrEnum):
    """What the mapper knows of the robot's place."""

    MAPPING = "mapping"
    """the map is being built, and the robot is in it"""
    LOCALISED = "localised"
    """the place in the saved map is known"""
    SEARCHING = "searching"
    """the place in the saved map is not known yet"""
    AMBIGUOUS = "ambiguous"
    """several places of the saved map look alike: the user has to say which"""
    LOST = "lost"
    """what the lidar sees does not fit the map"""


class MapperParameters(NamedTuple):
    """What a user can set."""

    resolution: float = 0.05
    """m, of a cell of the grid"""
    range_max: float = 12.0
    """m; points further from the lidar are not used"""
    keyframe_distance: float = 0.2
    """m, from a scan that is kept to the next one"""
    keyframe_turn: float = 0.35
    """rad, likewise"""


class Correction(NamedTuple):
    """The answer to a scan."""

    version: int
    """counts up with each answer"""
    number: int
    """of the scan"""
    time: float
    """s, of the scan"""
    transform: Array
    """x, y, heading of odom in map"""
    covariance: Array
    """3 x 3, of the robot's pose in map at `time`, along the axes of map"""
    state: MapperState
    changed_map: bool
    """whether `grid` gives another grid than before"""
    pose: Array
    """x, y, heading of base_link in map at `time`"""
    places: Array
    """K x 3: when ambiguous, the poses in map that fit alike"""
    fit: float
    """share of the scan's points that the map explains, 0 to 1"""


class Mapper:
    """Builds a map, or finds and follows the robot's pose in the saved map `saved`."""

    def __init__(self, parameters: MapperParameters, saved: Map | None = None) -> None:
        self.parameters = parameters
        self._saved = saved
        self._state = MapperState.MAPPING if saved is None else MapperState.SEARCHING
        self._tracker = ScanTracker(np.zeros(3), np.zeros((3, 3)))
        self._builder: MapBuilder | None = None
        self._last: MappedScan | None = None
        self._grid: OccupancyGrid | None = None
        self._version = 0
        if saved is not None:
            self._grid = saved.grid()

    def add(self, scan: MappedScan) -> Correction:
        """The pose at `scan`, and the map with it. A scan that is not newer changes nothing."""
        last = self._last
        if last is not None and scan.time <= last.time:
            return self._correction(last, changed_map=False, fit=0.0)
        scan = self._in_range(scan)
        surface = surface_points(scan.points, scan.origin)
        self._last = scan
        fit = 1.0
        if self._builder is None:
            self._tracker = ScanTracker(scan.odometry, np.zeros((3, 3)))
            self._builder = MapBuilder(self.parameters.resolution, scan.odometry)
            self._keep(scan, surface)
        elif last is not None:
            self._tracker.predict(last, scan)
            if self._builder.field is not None:
                fit = self._tracker.correct(self._builder.field, surface)
            if self._is_keyframe():
                self._keep(scan, surface)
            self.work(round((scan.time - last.time) / STEP_PERIOD))
        changed, self._builder.changed = self._builder.changed, False
        if changed:
            self._grid = None
        return self._correction(scan, changed, fit)

    def work(self, steps: int) -> bool:
        """Do waiting work in at most `steps` parts, of which each takes about 10 ms.

        Returns whether there may be more. `add` does as many as the time from scan to scan allows.
        """
        steps = min(max(steps, 1), STEPS_MAX)
        return self._builder is not None and all(self._builder.step() for _ in range(steps))

    def answer(self, pose: Array, covariance: Array) -> None:
        """The robot's pose in map at the last scan, as the user states it (3, and 3 x 3)."""
        self._tracker = ScanTracker(pose, covariance)
        self._state = MapperState.LOCALISED

    def grid(self) -> OccupancyGrid:
        """The map up to the last scan that changed it."""
        if self._grid is None and self._builder is not None:
            self._grid = self._builder.builder.grid(self._version)
        return self._grid or GridBuilder(self.parameters.resolution).grid(0)

    def map(self) -> Map:
        """What there is to save."""
        if self._saved is not None:
            return self._saved
        if self._builder is None:
            return Map(self.parameters.resolution, (), np.zeros((0, 3)))
        submaps = self._builder.submaps
        scans = tuple(each.scan for each in submaps.keyframes)
        return Map(self.parameters.resolution, scans, submaps.poses())

    def _in_range(self, scan: MappedScan) -> MappedScan:
        distance = np.hypot(*(scan.points - scan.origin).T)
        return scan._replace(points=scan.points[distance < self.parameters.range_max])

    def _is_keyframe(self) -> bool:
        if self._saved is not None or self._builder is None:
            return False
        motion = self._builder.motion(self._tracker.pose)
        return bool(
            np.hypot(motion[0], motion[1]) > self.parameters.keyframe_distance
            or abs(motion[2]) > self.parameters.keyframe_turn
        )

    def _keep(self, scan: MappedScan, surface: SurfacePoints) -> None:
        assert self._builder is not None
        self._builder.add(scan, surface, self._tracker.pose, self._tracker.covariance)
        self._tracker.covariance = FLOOR.copy()

    def _pose(self) -> tuple[Array, Array]:
        """Of the robot in map, and its covariance along the axes of map."""
        pose, covariance = self._tracker.pose, self._tracker.covariance
        if self._saved is None and self._builder is not None:
            covariance = self._builder.covariance(pose, covariance)
            pose = self._builder.in_map(pose)
        return pose, rotated_covariance(covariance, float(pose[2]))

    def _correction(self, scan: MappedScan, changed_map: bool, fit: float) -> Correction:
        self._version += 1
        pose, covariance = self._pose()
        return Correction(
            version=self._version,
            number=scan.number,
            time=scan.time,
            transform=compose(pose, inverse(scan.odometry)),
            covariance=covariance,
            state=self._state,
            changed_map=changed_map,
            pose=pose,
            places=np.zeros((0, 3)),
            fit=fit,
        )
