"""Where in a map the robot is, when nothing is known: searched in the whole map, in steps.

How well a scan fits does not show whether the place is right: rooms look alike. A place is
accepted when no other one fits nearly as well, twice, with a motion between that agrees with the
odometry.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from diffbotctl.mapping.branch_and_bound import Peak, Window, best_pose
from diffbotctl.mapping.lidar_scan import MappedScan, SurfacePoints
from diffbotctl.mapping.match_field import MatchField
from diffbotctl.mapping.occupancy_grid import GridBuilder
from diffbotctl.mapping.plane_pose import Array, apart, between, compose, transformed
from diffbotctl.mapping.scan_match import explained, refine
from diffbotctl.mapping.submaps import thinned

SCORE_MIN = 0.4
MARGIN = 0.06  # of the score, by which other places must fit worse
PLACES_MAX = 4
QUERY_POINTS = 120
SCANS_MERGED = 10
SPACING = (0.04, 0.08)  # m, rad; between scans that are merged
MOVED = (0.12, 0.25)  # m, rad; from one fix to the next one
AGREEMENT = (0.20, 0.10)  # m, rad; of two fixes with the odometry between them
MISFIT_SCALE = 0.07  # misfit that must hold for a metre
TURN_ARM = 0.3  # m a rad
EXPLAINED_MIN = 0.7  # share of a scan's points that lie at points of the map
FIXES_WITHOUT_PLACE = 4  # after so many the map does not fit
WEAK_PRIOR = np.diag([0.1, 0.1, 0.05]) ** 2
HINT_REACH = (3.0, 3.0, np.pi)  # m, m, rad, around what a user states
EDGE = 1.0  # m around `corners`


class PlaceCandidate(NamedTuple):
    """A pose in map that fits."""

    pose: Array
    """at the last fix"""
    fixes: int
    """that agree, in a row"""
    travelled: float
    """m, from the first to the last of them; a turn counts as TURN_ARM a radian"""
    misfit: float
    """share of the points that the map does not explain, mean of these fixes"""

    def is_proven(self) -> bool:
        """Whether it is right, given that no other place fits.

        In another building some room fits by three quarters; the worse the fit, the further must it
        hold.
        """
        return self.fixes > 1 and self.travelled > (self.misfit / MISFIT_SCALE) ** 2


class PlaceSearch:
    """Fixes of the robot's place in a map, one after the other as it moves."""

    def __init__(self, field: MatchField, drawn: GridBuilder, corners: Array) -> None:
        """`field`, `drawn`: of the whole map, in map; `corners`: around where a robot can be."""
        self.field, self._drawn = field, drawn
        low, high = corners
        middle = 0.5 * (low + high)
        self._window = Window(np.array([*middle, 0.0]), 0.5 * float((high - low).max()) + EDGE, 4.0)
        self._recent: deque[tuple[MappedScan, SurfacePoints]] = deque(maxlen=SCANS_MERGED)
        self._work: Generator[None] | None = None
        self._fixed_at: Array | None = None  # odometry at the last fix
        self._places: list[PlaceCandidate] = []  # at the last fix
        self._was_unique = False
        self.failed = 0
        """fixes in a row without a place that agrees with the one before"""
        self.found: Array | None = None
        """pose in map at the last scan, when it is certain"""

    def add(self, scan: MappedScan, surface: SurfacePoints) -> None:
        """The next scan."""
        if self._recent and not apart(self._recent[-1][0].odometry, scan.odometry, SPACING):
            self._recent.pop()
        self._recent.append((scan, surface))
        is_due = self._fixed_at is None or apart(self._fixed_at, scan.odometry, MOVED)
        if self._work is None and is_due and len(surface.points):
            self._work = self._fix()

    def step(self) -> bool:
        """Search further. Returns whether there was something to do."""
        if self._work is None:
            return False
        if next(self._work, "end") == "end":
            self._work = None
        return True

    def near(self, pose: Array, reach: Array) -> Array | None:
        """The best pose within `reach` (m, m, rad) of `pose`, at the last scan."""
        if not self._recent:
            return None
        reach = np.minimum(reach, HINT_REACH)
        window = Window(pose, float(max(reach[:2])), float(reach[2]))
        search = best_pose(self.field, self._query(), window, SCORE_MIN)
        while True:
            try:
                next(search)
            except StopIteration as end:
                peak: Peak | None = end.value
                return None if peak is None else peak.pose

    def places(self) -> Array:
        """K x 3: poses in map at the last scan of the places that fit alike; often none."""
        agreed = [each.pose for each in self._places if each.fixes > 1]
        if len(agreed) < 2 or self._fixed_at is None:
            return np.zeros((0, 3))
        motion = between(self._fixed_at, self._recent[-1][0].odometry)
        return compose(np.array(agreed), motion)

    def _query(self) -> Array:
        """Points of the recent scans in the frame of the last one."""
        here = self._recent[-1][0].odometry
        points = [
            transformed(surface.points, between(here, scan.odometry))
            for scan, surface in self._recent
        ]
        even = thinned(np.vstack(points))
        self._recent = deque([self._recent[-1]], SCANS_MERGED)
        return even[:: -(-len(even) // QUERY_POINTS)]

    def _fix(self) -> Generator[None]:
        """One search of the whole map, and what it means together with the one before."""
        scan, surface = self._recent[-1]
        points = self._query()
        poses: list[Array] = []
        least = SCORE_MIN
        while len(poses) < PLACES_MAX:
            peak = yield from best_pose(self.field, points, self._window, least, poses)
            if peak is None:
                break
            if not poses:
                least = (1 - MARGIN) * peak.score
            poses.append(peak.pose)
        places = []
        for pose in poses:
            fit = refine(self.field, surface, pose, pose, WEAK_PRIOR)
            share = explained(self.field, surface, fit.pose)
            if share > EXPLAINED_MIN:
                misfit = 1 - share + 0.5 * self._drawn.contradicted(scan, fit.pose)
                places.append(self._continued(fit.pose, scan, misfit))
            yield
        is_unique = len(poses) == 1 and len(places) == 1
        self.failed = 0 if any(each.fixes > 1 for each in places) else self.failed + 1
        if is_unique and self._was_unique and places[0].is_proven():
            motion = between(scan.odometry, self._recent[-1][0].odometry)
            self.found = compose(places[0].pose, motion)
        self._places, self._was_unique = places, is_unique
        self._fixed_at = scan.odometry

    def _continued(self, pose: Array, scan: MappedScan, misfit: float) -> PlaceCandidate:
        """The place with the fixes before this one that agree with `pose` at `scan`."""
        if self._fixed_at is not None:
            motion = between(self._fixed_at, scan.odometry)
            way = float(np.hypot(motion[0], motion[1]) + TURN_ARM * abs(motion[2]))
            for each in sorted(self._places, key=lambda place: -place.fixes):
                if not apart(compose(each.pose, motion), pose, AGREEMENT):
                    mean = (each.misfit * each.fixes + misfit) / (each.fixes + 1)
                    return PlaceCandidate(pose, each.fixes + 1, each.travelled + way, mean)
        return PlaceCandidate(pose, 1, 0.0, misfit)
