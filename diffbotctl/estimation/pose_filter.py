"""Dead reckoning: the pose in odom from the travel of two wheels, with its covariance.

Metres and radians, frame odom.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Protocol

from diffbotctl.control.pose_sd import largest_variance
from diffbotctl.estimation.geometry_deviation import (
    GeometryDeviation,
    PoseDeviation,
    combined,
    fault_effects,
)
from diffbotctl.messages import Odometry, PoseCovariance

Pose = tuple[float, float, float]  # x, y (m) and heading (rad) in odom.
Correction = tuple[float, float]  # Way ahead (m) and turn (rad) in addition to those of one frame.
# Mean square of the second-order term of a rotation, (angle^2 / 2)^2, over its variance^2: 3/4
# for a normal distribution. It moves the position towards the point that the path turns about.
BEND_RATIO = 0.75
# Of the standard deviation of the position in its worst direction, without slip: it is not known
# better than that in any other one. The errors are taken to turn the path about its start, but
# arose on the whole of a path that bends. Found with simulated robots.
LEAST_DIRECTION_RATIO = 0.2
NO_COVARIANCE: PoseCovariance = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_EFFECTS = (PoseDeviation(), PoseDeviation(), PoseDeviation())


class WheelTravel(Protocol):
    """Travel and speed of one wheel after a frame."""

    travel: float  # m, since the previous frame
    added_variance: float  # m2, of that travel
    start_correction: float  # m, added by a better estimate of the initial phase

    @property
    def speed(self) -> float:
        """m/s"""

    @property
    def coasting_travel(self) -> float:
        """m, without sign, that it travels until it rests when it is released now."""

    @property
    def variance(self) -> float:
        """Variance of the travel since the start, m2, if the best hypothesis is right."""

    @property
    def end_variance(self) -> float:
        """Variance of the present position of the wheel within a slot, m2."""

    @property
    def disagreement(self) -> float:
        """Variance of the travel, m2, between the hypotheses."""

    @property
    def fault_share(self) -> float:
        """Share of the edges that were missed or counted twice, and not corrected."""


class PoseFilter:
    """Integrates wheel travel into a pose, from the start or from the last restart of the board."""

    def __init__(
        self, track: float, slip: float, geometry: tuple[GeometryDeviation, ...] = ()
    ) -> None:
        """`track` in m; `slip`: standard deviation of a wheel's slip after one metre, in m;
        `geometry`: the independent errors of track and diameters."""
        self.track = track
        self.slip = slip
        self.geometry = geometry
        self.unit_effects = NO_EFFECTS
        self.x = self.y = self.heading = 0.0
        self.start()
        self.slip_covariance = NO_COVARIANCE

    def start(self) -> None:
        """Take the present pose as the point from which the wheels are counted."""
        self.start_x, self.start_y, self.start_heading = self.x, self.y, self.heading

    def set_pose(self, x: float, y: float, heading: float) -> None:
        """Set the pose (m, rad) with zero covariance; the starting point moves with it."""
        here = (self.x, self.y, self.heading)
        moved = (x - self.x, y - self.y, heading - self.heading)
        start = (self.start_x, self.start_y, self.start_heading)
        self.start_x, self.start_y, self.start_heading = turned(start, moved, here)
        self.x, self.y, self.heading = x, y, heading
        self.slip_covariance = NO_COVARIANCE
        self.unit_effects = NO_EFFECTS

    def move(self, left: WheelTravel, right: WheelTravel) -> None:
        """Advance by the travel of both wheels since the previous frame."""
        if left.start_correction or right.start_correction:
            self._correct_start(left.start_correction, right.start_correction)
        # The standard deviation of slip grows with the square root of the travel.
        slip_variance = self.slip * self.slip
        self._roll(
            left.travel,
            right.travel,
            slip_variance * abs(left.travel) + left.added_variance,
            slip_variance * abs(right.travel) + right.added_variance,
        )

    @property
    def _start(self) -> Pose:
        return self.start_x, self.start_y, self.start_heading

    def jump(self, left: float, right: float, sd: float) -> None:
        """Advance by wheel travel (m) known from counts alone, with standard deviation `sd` (m)."""
        variance = sd * sd if left or right else 0.0
        self._roll(left, right, variance, variance)

    def _correct_start(self, left: float, right: float) -> None:
        """Correct the travel of each wheel (m) at the start: the path turns about it."""
        ahead, turn = self._correction(left, right)
        direction = self.start_heading
        moved = (ahead * cos(direction), ahead * sin(direction), turn)
        self.x, self.y, self.heading = turned((self.x, self.y, self.heading), moved, self._start)

    def _correction(self, left: float, right: float) -> Correction:
        """Way and turn of a travel of each wheel (m)."""
        return 0.5 * (left + right), (right - left) / self.track

    def _roll(self, left: float, right: float, left_variance: float, right_variance: float) -> None:
        """Advance along one arc by the travel of each wheel (m) with its variance (m2)."""
        middle = self.heading + 0.5 * (right - left) / self.track
        direction = cos(middle), sin(middle)
        if left_variance or right_variance:
            self._add_covariance(left, right, left_variance, right_variance, direction)
        if left or right:
            of_track, of_left, of_right = self.unit_effects
            track, ahead = self.track, 0.5 * (left + right)
            self.unit_effects = (
                of_track.advanced(left - right, 0.0, ahead, track, direction),
                of_left.advanced(-left, left, ahead, track, direction),
                of_right.advanced(right, right, ahead, track, direction),
            )
        self.x, self.y, self.heading = arc(self.x, self.y, self.heading, left, right, self.track)

    def _add_covariance(
        self,
        left: float,
        right: float,
        left_variance: float,
        right_variance: float,
        direction: tuple[float, float],
    ) -> None:
        """`direction`: cosine and sine of the heading in the middle of the arc."""
        along = 0.25 * (left_variance + right_variance)
        along_heading = 0.5 * (right_variance - left_variance) / self.track
        heading = (left_variance + right_variance) / self.track**2
        self._propagate(0.5 * (left + right), along, heading, direction, along_heading)

    def _propagate(
        self,
        ahead: float,
        along: float,
        heading: float,
        direction: tuple[float, float],
        along_heading: float = 0.0,
    ) -> None:
        """Move the covariance on by `ahead` (m), with the variances of that way and of the turn,
        and the covariance of both."""
        xx, xy, xh, yy, yh, hh = self.slip_covariance
        c, s = direction
        x_h, y_h = -ahead * s, ahead * c
        self.slip_covariance = (
            xx + 2.0 * x_h * xh + x_h * x_h * hh + along * c * c,
            xy + x_h * yh + y_h * xh + x_h * y_h * hh + along * c * s,
            xh + x_h * hh + along_heading * c,
            yy + 2.0 * y_h * yh + y_h * y_h * hh + along * s * s,
            yh + y_h * hh + along_heading * s,
            hh + heading,
        )

    def _heading_variance(self, variance: float) -> float:
        """Variance of the turn (rad2) by that of both wheels' travel (m2)."""
        return variance / self.track**2

    def message(
        self, time: int, left: WheelTravel, right: WheelTravel, warning: str = ""
    ) -> Odometry:
        """The pose at `time` (ns) with both speeds and the covariance.

        The variance of a wheel's travel is treated as if all of it came from the initial phase, as
        most of it does: it turns the whole path about the start. The errors of the geometry are
        those of the path since the last `set_pose`.
        """
        travelled = left.variance + right.variance + left.disagreement + right.disagreement
        origins = [(self._start, travelled)]
        end = left.end_variance + right.end_variance
        if end:
            origins.append(((self.x, self.y, self.heading), end))
        here_x, here_y = self.x, self.y
        xx, xy, xh, yy, yh, hh = self.slip_covariance
        slip_xx, slip_xy, slip_yy = xx, xy, yy
        for (origin_x, origin_y, _), variance in origins:
            heading = self._heading_variance(variance)
            lever_x, lever_y = origin_y - here_y, here_x - origin_x
            along = 0.25 * variance  # in any direction: the heading has changed since
            bend = BEND_RATIO * heading * heading
            xx += lever_x * lever_x * heading + lever_y * lever_y * bend + along
            xy += lever_x * lever_y * (heading - bend)
            xh += lever_x * heading
            yy += lever_y * lever_y * heading + lever_x * lever_x * bend + along
            yh += lever_y * heading
            hh += heading
        geometry_xx = geometry_xy = geometry_yy = geometry_hh = 0.0
        effects = self.unit_effects
        for x, y, heading in combined(effects, self.geometry):
            geometry_xx += x * x
            geometry_xy += x * y
            geometry_yy += y * y
            geometry_hh += heading * heading
            xh += x * heading
            yh += y * heading
        left_share, right_share = left.fault_share, right.fault_share
        if left_share or right_share:
            for x, y, heading in fault_effects(effects, left_share, right_share):
                xx += x * x
                xy += x * y
                xh += x * heading
                yy += y * y
                yh += y * heading
                hh += heading * heading
        largest = largest_variance(xx - slip_xx, xy - slip_xy, yy - slip_yy)
        least = LEAST_DIRECTION_RATIO * LEAST_DIRECTION_RATIO * largest
        xx += least
        yy += least
        left_speed, right_speed = left.speed, right.speed
        return Odometry(
            time,
            here_x,
            here_y,
            self.heading,
            0.5 * (left_speed + right_speed),
            (right_speed - left_speed) / self.track,
            (xx + geometry_xx, xy + geometry_xy, xh, yy + geometry_yy, yh, hh + geometry_hh),
            warning,
            sqrt(largest_variance(geometry_xx, geometry_xy, geometry_yy)),
            sqrt(geometry_hh),
            _coast_time(left, right),
        )


def _coast_time(left: WheelTravel, right: WheelTravel) -> float:
    """Time (s) which, with the speeds of the wheels, gives their travel after a release."""
    speeds = abs(left.speed) + abs(right.speed)
    return (left.coasting_travel + right.coasting_travel) / speeds if speeds else 0.0


def arc(
    x: float, y: float, heading: float, left: float, right: float, track: float
) -> tuple[float, float, float]:
    """The pose (m, rad) after the wheels travel `left` and `right` (m) along one exact arc."""
    half = 0.5 * (right - left) / track
    chord = 0.5 * (left + right) * (sin(half) / half if half else 1.0)
    middle = heading + half
    return x + chord * cos(middle), y + chord * sin(middle), middle + half


def turned(pose: Pose, moved: Pose, origin: Pose) -> Pose:
    """A pose of a rigid path whose pose `origin` changes by `moved` (m, m, rad)."""
    x, y = pose[0] - origin[0], pose[1] - origin[1]
    c, s = cos(moved[2]), sin(moved[2])
    return (
        origin[0] + moved[0] + x * c - y * s,
        origin[1] + moved[1] + x * s + y * c,
        pose[2] + moved[2],
    )
