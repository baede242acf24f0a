"""Dead reckoning: the pose in odom from the travel of two wheels, with its covariance.

Metres and radians, frame odom.
"""

from __future__ import annotations

from math import cos, sin
from typing import Protocol

from diffbotctl.messages import Odometry

PoseCovariance = tuple[float, float, float, float, float, float]
"""Upper triangle of the covariance of (x, y, heading): xx xy xh yy yh hh."""
NO_COVARIANCE: PoseCovariance = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class WheelTravel(Protocol):
    """Travel and speed of one wheel after a frame."""

    travel: float  # m, since the previous frame
    start_correction: float  # m, added by a better estimate of the initial phase

    @property
    def speed(self) -> float:
        """m/s"""

    @property
    def variance(self) -> float:
        """Variance of the travel since the start, m2."""


class PoseFilter:
    """Integrates wheel travel into a pose, from the start or from the last restart of the board."""

    def __init__(self, track: float, slip: float) -> None:
        """`track` in m; `slip`: standard deviation of a wheel's slip after one metre, in m."""
        self.track = track
        self.slip = slip
        self.x = self.y = self.heading = 0.0
        self.start()
        self.slip_covariance = NO_COVARIANCE

    def start(self) -> None:
        """Take the present pose as the point from which the wheels are counted."""
        self.start_x, self.start_y, self.start_heading = self.x, self.y, self.heading

    def set_pose(self, x: float, y: float, heading: float) -> None:
        """Set the pose (m, rad) with zero covariance; the starting point moves with it."""
        turn = heading - self.heading
        c, s = cos(turn), sin(turn)
        back_x, back_y = self.start_x - self.x, self.start_y - self.y
        self.start_x = x + back_x * c - back_y * s
        self.start_y = y + back_x * s + back_y * c
        self.start_heading += turn
        self.x, self.y, self.heading = x, y, heading
        self.slip_covariance = NO_COVARIANCE

    def move(self, left: WheelTravel, right: WheelTravel) -> None:
        """Advance by the travel of both wheels since the previous frame."""
        if left.start_correction or right.start_correction:
            self._correct_start(left.start_correction, right.start_correction)
        # The standard deviation of slip grows with the square root of the travel.
        slip_variance = self.slip * self.slip
        self._roll(
            left.travel,
            right.travel,
            slip_variance * abs(left.travel),
            slip_variance * abs(right.travel),
        )

    def jump(self, left: float, right: float, sd: float) -> None:
        """Advance by wheel travel (m) known from counts alone, with standard deviation `sd` (m)."""
        variance = sd * sd if left or right else 0.0
        self._roll(left, right, variance, variance)

    def _correct_start(self, left: float, right: float) -> None:
        """Correct the initial travel of each wheel (m): the path turns about the start."""
        angle = (right - left) / self.track
        ahead = 0.5 * (left + right)
        x, y = self.x - self.start_x, self.y - self.start_y
        c, s = cos(angle), sin(angle)
        self.x = self.start_x + x * c - y * s + ahead * cos(self.start_heading)
        self.y = self.start_y + x * s + y * c + ahead * sin(self.start_heading)
        self.heading += angle

    def _roll(self, left: float, right: float, left_variance: float, right_variance: float) -> None:
        """Advance along one arc by the travel of each wheel (m) with its variance (m2)."""
        if left_variance or right_variance:
            self._add_covariance(left, right, left_variance, right_variance)
        self.x, self.y, self.heading = arc(self.x, self.y, self.heading, left, right, self.track)

    def _add_covariance(
        self, left: float, right: float, left_variance: float, right_variance: float
    ) -> None:
        xx, xy, xh, yy, yh, hh = self.slip_covariance
        middle = self.heading + 0.5 * (right - left) / self.track
        c, s = cos(middle), sin(middle)
        ahead = 0.5 * (left + right)
        x_h, y_h = -ahead * s, ahead * c
        along = 0.25 * (left_variance + right_variance)
        along_heading = 0.5 * (right_variance - left_variance) / self.track
        heading = (left_variance + right_variance) / self.track**2
        self.slip_covariance = (
            xx + 2.0 * x_h * xh + x_h * x_h * hh + along * c * c,
            xy + x_h * yh + y_h * xh + x_h * y_h * hh + along * c * s,
            xh + x_h * hh + along_heading * c,
            yy + 2.0 * y_h * yh + y_h * y_h * hh + along * s * s,
            yh + y_h * hh + along_heading * s,
            hh + heading,
        )

    def message(self, time: int, left: WheelTravel, right: WheelTravel) -> Odometry:
        """The pose at `time` (ns) with both speeds and the covariance.

        The variance of a wheel's travel is treated as if all of it came from the initial phase, as
        most of it does: it turns the whole path about the start.
        """
        variance = left.variance + right.variance
        heading = variance / self.track**2
        lever_x, lever_y = self.start_y - self.y, self.x - self.start_x
        along = 0.25 * variance
        c, s = cos(self.heading), sin(self.heading)
        xx, xy, xh, yy, yh, hh = self.slip_covariance
        return Odometry(
            time,
            self.x,
            self.y,
            self.heading,
            0.5 * (left.speed + right.speed),
            (right.speed - left.speed) / self.track,
            (
                xx + lever_x * lever_x * heading + along * c * c,
                xy + lever_x * lever_y * heading + along * c * s,
                xh + lever_x * heading,
                yy + lever_y * lever_y * heading + along * s * s,
                yh + lever_y * heading,
                hh + heading,
            ),
        )


def arc(
    x: float, y: float, heading: float, left: float, right: float, track: float
) -> tuple[float, float, float]:
    """The pose (m, rad) after the wheels travel `left` and `right` (m) along one exact arc."""
    half = 0.5 * (right - left) / track
    chord = 0.5 * (left + right) * (sin(half) / half if half else 1.0)
    middle = heading + half
    return x + chord * cos(middle), y + chord * sin(middle), middle + half
