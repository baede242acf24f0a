"""Where the robot is in the map, and the map itself, from scans and odometry.

The pose in odom is never changed: what comes back is the pose of odom in map (REP-105).
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import numpy as np

from diffbotctl.mapping.lidar_scan import MappedScan, SurfacePoints, surface_points
from diffbotctl.mapping.map_builder import MapBuilder, resumed
from diffbotctl.mapping.match_field import MatchField
from diffbotctl.mapping.occupancy_grid import GridBuilder, OccupancyGrid
from diffbotctl.mapping.place_search import FIXES_WITHOUT_PLACE, PlaceSearch
from diffbotctl.mapping.plane_pose import Array, apart, compose, inverse, rotated_covariance
from diffbotctl.mapping.scan_map import Map
from diffbotctl.mapping.scan_match import explained
from diffbotctl.mapping.scan_tracker import FLOOR, ScanTracker
from diffbotctl.mapping.submaps import Submaps

STEP_PERIOD = 0.05  # s, of the time from scan to scan, for one step of the waiting work
STEPS_MAX = 60  # for one scan
SEARCH_STEPS = 3  # of the search for the robot's place, for each scan
FOUND = np.diag([0.10, 0.10, 0.05]) ** 2  # covariance of a place that was found
HEADING_KNOWN = 1.0  # rad, standard deviation of a pose that can be taken without a search
UNKNOWN = np.diag([50.0, 50.0, np.pi]) ** 2
# Rays of a scan that fits the map: share of all, and relative to those that the map explains.
CONTRADICTED_MAX, CONTRADICTED_RATIO_MAX = 0.25, 0.75
MISMATCHES_MAX = 5  # scans in a row
SUDDEN = (0.2, 0.35)  # m, rad, by odometry; after more motion a scan may show a place not seen yet
LOOK_PERIOD = 1.0  # s, between looks from one place
LOOKS_MAX = 6  # from one place
CHANGED_MIN = 0.02  # share of the rays that pass through what has moved


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
    """Builds a map, or finds and follows the robot's pose in the saved map `saved`.

    `grows`: once the pose in `saved` is found, that map is built on.
    """

    def __init__(
        self, parameters: MapperParameters, saved: Map | None = None, grows: bool = False
    ) -> None:
        self.parameters = parameters
        self._saved = saved if saved and (saved.scans or saved.imported) else None
        self._tracker = ScanTracker(np.zeros(3), UNKNOWN)
        self._builder: MapBuilder | None = None
        self._drawn = GridBuilder(parameters.resolution)
        self._field: MatchField | None = None
        self._search: PlaceSearch | None = None
        self._state = MapperState.MAPPING
        self._last: MappedScan | None = None
        self._looked: tuple[float, Array, int] | None = None  # time, pose, looks from there
        self._mismatches = 0
        self._fitted = np.zeros(3)  # odometry at the last scan that fitted
        self._grid: OccupancyGrid | None = None
        self._version = 0
        if self._saved is not None:
            self._drawn, self._field = self._saved.drawn(), self._saved.field()
            self._search = PlaceSearch(self._field, self._drawn, self._saved.corners())
            self._state = MapperState.SEARCHING
            if grows:
                self._builder = resumed(parameters.resolution, self._saved)
                self._saved = self._field = None

    def add(self, scan: MappedScan) -> Correction:
        """The pose at `scan`, and the map with it. A scan that is not newer changes nothing."""
        last = self._last
        if last is not None and scan.time <= last.time:
            return self._correction(last, False, 0.0)
        scan = self._in_range(scan)
        surface = surface_points(scan.points, scan.origin)
        changed, fit = False, 0.0
        if last is not None:
            self._tracker.predict(last, scan)
        if self._search is not None:
            self._search_place(self._search, scan, surface)
        elif self._saved is None and self._builder is None:
            self._builder = MapBuilder(self.parameters.resolution, scan.odometry)
            self._tracker = ScanTracker(scan.odometry, np.zeros((3, 3)))
            changed = self._look(scan, surface)
        else:
            fit = self._follow(scan, surface)
            changed = self._search is None and self._is_look(scan) and self._look(scan, surface)
        self._last = scan
        if self._search is None:
            self.work(round((scan.time - last.time) / STEP_PERIOD) if last is not None else 1)
        changed |= self._revised()
        return self._correction(scan, changed, fit)

    def work(self, steps: int) -> bool:
        """Do waiting work in at most `steps` parts, of which each takes about 10 ms.

        Returns whether there may be more. `add` does as many as the time from scan to scan allows.
        """
        steps = min(max(steps, 1), STEPS_MAX)
        return self._builder is not None and all(self._builder.step() for _ in range(steps))

    def answer(self, pose: Array, covariance: Array) -> bool:
        """The robot's pose in map at the last scan, as the user states it (3, and 3 x 3).

        The best place within 3 sigma is taken, or, where nothing fits, `pose` itself; if its
        heading is not known, none is, and the answer is False.
        """
        pose, covariance = np.array(pose, float), np.array(covariance, float)
        better = None
        if self._search is not None:
            better = self._search.near(pose, 3 * np.sqrt(np.diag(covariance)))
        if better is not None:
            pose, covariance = better, FOUND
        elif covariance[2, 2] > HEADING_KNOWN**2:
            return False
        self._place(pose, rotated_covariance(covariance, -float(pose[2])))
        return True

    @property
    def is_searching(self) -> bool:
        """Whether the robot's place in the map is not known."""
        return self._search is not None

    @property
    def submaps(self) -> Submaps:
        """What the map is built from; a mapper that only finds its place has none."""
        assert self._builder is not None
        return self._builder.submaps

    def grid(self) -> OccupancyGrid:
        """The map up to the last scan that changed it."""
        if self._grid is None:
            self._grid = self._drawn.grid()
        return self._grid

    @property
    def resolution(self) -> float:
        """m, of a cell of `grid`: that of a saved map may differ from the parameter's."""
        return self._drawn.resolution

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

    def _search_place(self, search: PlaceSearch, scan: MappedScan, surface: SurfacePoints) -> None:
        search.add(scan, surface)
        for _ in range(SEARCH_STEPS):
            if not search.step():
                break
        if search.found is not None:
            self._place(search.found, FOUND)
        elif len(search.places()):
            self._state = MapperState.AMBIGUOUS
        elif search.failed >= FIXES_WITHOUT_PLACE:
            self._state = MapperState.LOST

    def _place(self, pose: Array, covariance: Array) -> None:
        """The robot is at `pose` in map."""
        self._search, self._mismatches = None, 0
        self._state = MapperState.LOCALISED
        if self._saved is None and self._builder is not None:
            self._state = MapperState.MAPPING
            pose = self._builder.jump(pose)
        self._tracker = ScanTracker(pose, covariance)

    def _follow(self, scan: MappedScan, surface: SurfacePoints) -> float:
        """Match the scan with the map, and notice when it does not fit. Returns the fit."""
        field = self._field if self._builder is None else self._builder.field
        assert field is not None
        fit = self._tracker.correct(field, surface)
        limit = CONTRADICTED_RATIO_MAX * explained(field, surface, self._tracker.pose)
        contradicted = self._drawn.contradicted(scan, self._pose()[0])
        is_wrong = contradicted > max(CONTRADICTED_MAX, limit)
        is_near = self._builder is None or not apart(self._fitted, scan.odometry, SUDDEN)
        if not is_wrong:
            self._fitted, self._mismatches = scan.odometry, 0
        elif self._mismatches or is_near:
            self._mismatches += 1
        if self._mismatches >= MISMATCHES_MAX:
            known = self.map()
            self._search = PlaceSearch(self._field or known.field(), self._drawn, known.corners())
            self._state = MapperState.LOST
        return fit

    def _is_look(self, scan: MappedScan) -> bool:
        """Whether the scan is from a new place, or shows that something has moved."""
        if self._mismatches or self._looked is None:
            return not self._mismatches
        time, pose, looks = self._looked
        limits = self.parameters.keyframe_distance, self.parameters.keyframe_turn
        if apart(pose, self._tracker.pose, limits):
            return True
        is_due = scan.time - time >= LOOK_PERIOD and looks < LOOKS_MAX
        return is_due and self._drawn.contradicted(scan, self._pose()[0]) > CHANGED_MIN

    def _look(self, scan: MappedScan, surface: SurfacePoints) -> bool:
        """Draw the scan, and keep it where a map is being built."""
        pose, looks = self._tracker.pose, 1
        if self._looked is not None and not np.hypot(*(pose - self._looked[1])[:2]) > 0.02:
            looks = self._looked[2] + 1
        self._looked = scan.time, pose.copy(), looks
        if self._builder is not None:
            self._builder.add(scan, surface, pose, self._tracker.covariance)
            self._tracker.covariance = FLOOR.copy()
        self._drawn.insert(scan, self._pose()[0])
        self._grid = None
        return True

    def _revised(self) -> bool:
        """Take the grid that was drawn again after a loop was closed."""
        if self._builder is None or self._builder.redrawn is None:
            return False
        self._drawn, self._builder.redrawn = self._builder.redrawn, None
        self._grid = None
        return True

    def _pose(self) -> tuple[Array, Array]:
        """Of the robot in map, and its covariance along the axes of map."""
        pose, covariance = self._tracker.pose, self._tracker.covariance
        if self._builder is not None:
            covariance = self._builder.covariance(pose, covariance)
            pose = self._builder.in_map(pose)
        if self._search is not None:
            covariance = UNKNOWN
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
            places=np.zeros((0, 3)) if self._search is None else self._search.places(),
            fit=fit,
        )
