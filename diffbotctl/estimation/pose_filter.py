"""A pose in odom from two wheels' travel, and how sure it is. Metres, radians; frame odom."""

from __future__ import annotations

from math import cos, sin
from typing import Protocol

from diffbotctl.messages import Odometry


class WheelTravel(Protocol):
    """What one wheel tells of itself after a frame."""

    rolled: float  # m, since the frame before
    begun: float  # m, by which the first stretch from the start has turned out longer

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
        self.slipped = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # covariance by slip: xx xy xh yy yh hh

    def start(self) -> None:
        """Wheels are counted anew from here."""
        self.first_x, self.first_y, self.first_heading = self.x, self.y, self.heading

    def place(self, x: float, y: float, heading: float) -> None:
        """Be there from now on, and sure of it: the way so far is moved along, m and rad."""
        turn = heading - self.heading
        c, s = cos(turn), sin(turn)
        back_x, back_y = self.first_x - self.x, self.first_y - self.y
        self.first_x = x + back_x * c - back_y * s
        self.first_y = y + back_x * s + back_y * c
        self.first_heading += turn
        self.x, self.y, self.heading = x, y, heading
        self.slipped = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def move(self, left: WheelTravel, right: WheelTravel) -> None:
        """Roll on as the wheels have since the last frame."""
        if left.begun or right.begun:
            self._begin_again(left.begun, right.begun)
        self._slip(left.rolled, right.rolled)
        self.x, self.y, self.heading = arc(
            self.x, self.y, self.heading, left.rolled, right.rolled, self.track
        )

    def jump(self, left: float, right: float, doubt: float) -> None:
        """Roll on by what was counted unseen, each wheel with a standard deviation of `doubt` (m),
        if any was."""
        if left or right:
            self._spread(left, right, doubt * doubt, doubt * doubt)
        self.x, self.y, self.heading = arc(self.x, self.y, self.heading, left, right, self.track)

    def _begin_again(self, left: float, right: float) -> None:
        """A wheel went further in its first stretch than was thought: all that came after lies
        turned about the start."""
        angle = (right - left) / self.track
        ahead = 0.5 * (left + right)
        x, y = self.x - self.first_x, self.y - self.first_y
        c, s = cos(angle), sin(angle)
        self.x = self.first_x + x * c - y * s + ahead * cos(self.first_heading)
        self.y = self.first_y + x * s + y * c + ahead * sin(self.first_heading)
        self.heading += angle

    def _slip(self, left: float, right: float) -> None:
        """Each wheel's slip grows with the root of its travel and shifts and turns the pose."""
        per_metre = self.slip * self.slip
        a, b = per_metre * abs(left), per_metre * abs(right)
        if a or b:
            self._spread(left, right, a, b)

    def _spread(self, left: float, right: float, a: float, b: float) -> None:
        """The covariance after ways of variances `a` and `b` (m2)."""
        xx, xy, xh, yy, yh, hh = self.slipped
        middle = self.heading + 0.5 * (right - left) / self.track
        c, s = cos(middle), sin(middle)
        ahead = 0.5 * (left + right)
        to_x, to_y = -ahead * s, ahead * c
        along, across, around = (
            0.25 * (a + b),
            0.5 * (b - a) / self.track,
            (a + b) / self.track**2,
        )
        self.slipped = (
            xx + 2.0 * to_x * xh + to_x * to_x * hh + along * c * c,
            xy + to_x * yh + to_y * xh + to_x * to_y * hh + along * c * s,
            xh + to_x * hh + across * c,
            yy + 2.0 * to_y * yh + to_y * to_y * hh + along * s * s,
            yh + to_y * hh + across * s,
            hh + around,
        )

    def message(self, time: int, left: WheelTravel, right: WheelTravel) -> Odometry:
        """The pose at `time` (ns) with both speeds and the covariance.

        What the filters do not know of a wheel's travel counts as if it lay in the first stretch,
        as most of it does: it turns all that came after about the start.
        """
        unsure = left.variance + right.variance
        hh = unsure / self.track**2
        lever_x, lever_y = self.first_y - self.y, self.x - self.first_x
        along = 0.25 * unsure
        c, s = cos(self.heading), sin(self.heading)
        a, b, d, e, f, g = self.slipped
        return Odometry(
            time,
            self.x,
            self.y,
            self.heading,
            0.5 * (left.speed + right.speed),
            (right.speed - left.speed) / self.track,
            (
                a + lever_x * lever_x * hh + along * c * c,
                b + lever_x * lever_y * hh + along * c * s,
                d + lever_x * hh,
                e + lever_y * lever_y * hh + along * s * s,
                f + lever_y * hh,
                g + hh,
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
