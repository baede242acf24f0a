"""Where the robot is in the map, and the map itself, from scans and odometry.

The pose in odom is never changed: what comes back is the pose of odom in map (REP-105).
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import numpy as np

from diffbotctl.mapping.lidar_scan import MappedScan, SurfacePoints, surface_points
from diffbotctl.mapping.match_field import MatchField, joined
from diffbotctl.mapping.occupancy_grid import GridBuilder, OccupancyGrid
from diffbotctl.mapping.plane_pose import Array, between, compose, inverse, rotated_covariance
from diffbotctl.mapping.scan_map import Map
from diffbotctl.mapping.scan_match import match

REFERENCE_SCANS = 40  # the last keyframes that a scan is matched against


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
        self._scans: list[MappedScan] = []
        self._surfaces: list[SurfacePoints] = []
        self._poses: list[Array] = []
        self._field: MatchField | None = None
        self._last: MappedScan | None = None
        self._pose = np.zeros(3)
        self._covariance = 1e-6 * np.eye(3)
        self._builder = GridBuilder(parameters.resolution)
        self._grid: OccupancyGrid | None = None
        self._version = 0
        if saved is not None:
            self._grid = saved.grid()

    def add(self, scan: MappedScan) -> Correction:
        """The pose at `scan`, and the map with it. A scan that is not newer changes nothing."""
        changed = False
        fit = 0.0
        scan = self._in_range(scan)
        if self._last is None:
            self._pose = np.array(scan.odometry, float)
        elif scan.time <= self._last.time:
            return self._correction(self._last, changed_map=False, fit=0.0)
        else:
            fit = self._follow(scan, self._last)
        self._last = scan
        if self._is_keyframe():
            self._keep(scan)
            changed = True
        return self._correction(scan, changed, fit)

    def answer(self, pose: Array, covariance: Array) -> None:
        """The robot's pose in map at the last scan, as the user states it (3, and 3 x 3)."""
        self._pose = np.array(pose, float)
        self._covariance = np.array(covariance, float)
        self._state = MapperState.LOCALISED

    def grid(self) -> OccupancyGrid:
        """The map up to the last scan that changed it."""
        if self._grid is None:
            self._grid = self._builder.grid(self._version)
        return self._grid

    def map(self) -> Map:
        """What there is to save."""
        if self._saved is not None:
            return self._saved
        return Map(
            self.parameters.resolution, tuple(self._scans), np.array(self._poses).reshape(-1, 3)
        )

    def _in_range(self, scan: MappedScan) -> MappedScan:
        distance = np.hypot(*(scan.points - scan.origin).T)
        return scan._replace(points=scan.points[distance < self.parameters.range_max])

    def _follow(self, scan: MappedScan, last: MappedScan) -> float:
        motion = between(last.odometry, scan.odometry)
        spread = motion_covariance(last, scan)
        prior = compose(self._pose, motion)
        if self._field is None:
            self._pose = prior
            return 0.0
        covariance = rotated_covariance(spread, float(prior[2]))
        fitted = match(self._field, surface_points(scan.points, scan.origin), prior, covariance)
        self._pose = fitted.pose
        self._covariance = np.linalg.inv(fitted.information + np.linalg.inv(covariance))
        return fitted.overlap

    def _is_keyframe(self) -> bool:
        if self._saved is not None:
            return False
        if not self._poses:
            return True
        motion = between(self._poses[-1], self._pose)
        return bool(
            np.hypot(motion[0], motion[1]) > self.parameters.keyframe_distance
            or abs(motion[2]) > self.parameters.keyframe_turn
        )

    def _keep(self, scan: MappedScan) -> None:
        self._scans.append(scan)
        self._surfaces.append(surface_points(scan.points, scan.origin))
        self._poses.append(self._pose.copy())
        recent = slice(-REFERENCE_SCANS, None)
        self._field = MatchField(joined(self._surfaces[recent], np.array(self._poses[recent])))
        self._builder.insert(scan, self._pose)
        self._grid = None

    def _correction(self, scan: MappedScan, changed_map: bool, fit: float) -> Correction:
        self._version += 1
        return Correction(
            version=self._version,
            number=scan.number,
            time=scan.time,
            transform=compose(self._pose, inverse(scan.odometry)),
            covariance=self._covariance,
            state=self._state,
            changed_map=changed_map,
            pose=self._pose.copy(),
            places=np.zeros((0, 3)),
            fit=fit,
        )


def motion_covariance(last: MappedScan, scan: MappedScan) -> Array:
    """Covariance of the motion from `last` to `scan` in the frame at `scan`.

    What the odometry's covariance grew by, and at least what slip of wheels on a floor adds.
    """
    dx, dy = scan.odometry[:2] - last.odometry[:2]
    carried = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    grown = scan.covariance - carried @ last.covariance @ carried.T
    grown = rotated_covariance(0.5 * (grown + grown.T), -float(scan.odometry[2]))
    values, vectors = np.linalg.eigh(grown)
    grown = (vectors * np.maximum(values, 0.0)) @ vectors.T
    motion = between(last.odometry, scan.odometry)
    distance, turn = float(np.hypot(motion[0], motion[1])), abs(float(motion[2]))
    along = 0.005 + 0.10 * distance + 0.02 * turn
    heading = 0.005 + 0.10 * turn + 0.02 * distance
    covariance: Array = grown + np.diag([along**2, along**2, heading**2])
    return covariance
