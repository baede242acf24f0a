"""A pose in odom from two wheels' travel, and how sure it is. Metres, radians; frame odom."""

from __future__ import annotations

from math import cos, sin
from typing import Protocol

from diffbotctl.messages import Odometry

PoseCovariance = tuple[float, float, float, float, float, float]
"""xx xy xh yy yh hh, h being the heading"""
NO_COVARIANCE: PoseCovariance = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class WheelTravel(Protocol):
    """What one wheel tells of itself after a frame."""

    travel: float  # m, since the frame before
    start_correction: float  # m, by which the first stretch from the start has turned out longer

    @property
    def speed(self) -> float:
        """m/s"""

    @property
    def variance(self) -> float:
        """Variance of the travel since the start, m2."""


class PoseFilter:
    """Where the robot is, from where odom began or where the board last restarted."""

    def __init__(self, track: float, slip: float) -> None:
        """`track` (m); `slip`: standard deviation of a wheel's slip after a metre (m)."""
        self.track = track
        self.slip = slip
        self.x = self.y = self.heading = 0.0
        self.start()
        self.slip_covariance = NO_COVARIANCE

    def start(self) -> None:
        """Wheels are counted anew from here."""
        self.start_x, self.start_y, self.start_heading = self.x, self.y, self.heading

    def set_pose(self, x: float, y: float, heading: float) -> None:
        """Be there from now on, and sure of it: the way so far is moved along, m and rad."""
        turn = heading - self.heading
        c, s = cos(turn), sin(turn)
        back_x, back_y = self.start_x - self.x, self.start_y - self.y
        self.start_x = x + back_x * c - back_y * s
        self.start_y = y + back_x * s + back_y * c
        self.start_heading += turn
        self.x, self.y, self.heading = x, y, heading
        self.slip_covariance = NO_COVARIANCE

    def move(self, left: WheelTravel, right: WheelTravel) -> None:
        """Roll on as the wheels have since the last frame."""
        if left.start_correction or right.start_correction:
            self._correct_start(left.start_correction, right.start_correction)
        # The slip of a wheel grows with the root of its travel.
        slip_variance = self.slip * self.slip
        self._roll(
            left.travel,
            right.travel,
            slip_variance * abs(left.travel),
            slip_variance * abs(right.travel),
        )

    def jump(self, left: float, right: float, sd: float) -> None:
        """Roll on by what was counted unseen, each wheel with a standard deviation of `sd` (m), if
        any was."""
        variance = sd * sd if left or right else 0.0
        self._roll(left, right, variance, variance)

    def _correct_start(self, left: float, right: float) -> None:
        """A wheel went further in its first stretch than was thought: all that came after lies
        turned about the start."""
        angle = (right - left) / self.track
        ahead = 0.5 * (left + right)
        x, y = self.x - self.start_x, self.y - self.start_y
        c, s = cos(angle), sin(angle)
        self.x = self.start_x + x * c - y * s + ahead * cos(self.start_heading)
        self.y = self.start_y + x * s + y * c + ahead * sin(self.start_heading)
        self.heading += angle

    def _roll(self, left: float, right: float, left_variance: float, right_variance: float) -> None:
        """Roll each wheel by a travel (m) of some variance (m2): it shifts and turns the pose."""
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

        What the filters do not know of a wheel's travel counts as if it lay in the first stretch,
        as most of it does: it turns all that came after about the start.
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
    """The pose after the wheels rolled `left` and `right` (m) along one exact arc."""
    half = 0.5 * (right - left) / track
    chord = 0.5 * (left + right) * (sin(half) / half if half else 1.0)
    middle = heading + half
    return x + chord * cos(middle), y + chord * sin(middle), middle + half
