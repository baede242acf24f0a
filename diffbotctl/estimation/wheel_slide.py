"""Wheels that slide on the floor, as a gyro shows: they turn the robot further than it turns.

A driven wheel that slides travels less than it turns, and the middle of the axle lacks half of it.
The gyro does not show what both wheels slide alike. Lengths in m, angles in rad.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, cos, hypot, radians, sin, sqrt
from typing import NamedTuple

from diffbotctl.estimation.geometry_deviation import GeometryDeviation, PoseDeviation
from diffbotctl.estimation.gyro_turn import TurnStep
from diffbotctl.estimation.pose_filter import WheelTravel

# Turns by wheels and gyro that differ by more are those of wheels that slide: by a part of the
# wheels' turn, for tyres scrub, and by standard deviations of all errors that are known.
TURN_MIN, TURN_SHARE, TURN_SDS = radians(2.0), 0.05, 4.0
HEADED_MIN = 0.6  # of the path, as a vector: that of a turn by 190 deg
PATH_MAX = 0.5  # m; on a longer way the errors of the diameters hide what a wheel slides


class Slide(NamedTuple):
    """A slide that was found."""

    turn: float
    """of the wheels less that of the gyro, rad"""
    x: float
    y: float
    """m, by which the robot has travelled less than its wheels, in odom"""


class Slid(NamedTuple):
    """What wheels that slid have done to the position."""

    x: float = 0.0
    y: float = 0.0
    """m, the sum of all slides"""
    along: PoseDeviation = PoseDeviation()
    """one standard deviation of that"""
    around: float = 0.0
    """by those of an unknown wheel: variance in any direction, m2"""


class WheelSlide:
    """What the wheels slide, from their turns and those of the gyro: `slid`.

    `agreed_path` (m, of the axle) and `agreed_turn` (rad): on which both turns have agreed since
    the last slide. An encoder that counts half of its edges, or twice, makes them differ.
    """

    def __init__(
        self, track: float, slip: float, geometry: Sequence[GeometryDeviation], scale_sd: float
    ) -> None:
        """As GyroPoseFilter."""
        self.track, self.slip, self.geometry, self.scale_sd = track, slip, geometry, scale_sd
        self.agreed_path = self.agreed_turn = 0.0
        self._by_gyro = 0.0
        self.forget()

    def forget(self) -> None:
        """The position is known exactly from now on."""
        self.slid = Slid()
        self.compare_from_here()

    def compare_from_here(self) -> None:
        """Compare the turns from now on; they have agreed until here."""
        self.agreed_turn += abs(self._by_gyro)
        self._left = self._right = self._path = 0.0
        self._by_gyro = self._seconds = 0.0
        self._x = self._y = 0.0

    @property
    def has_slid(self) -> bool:
        """Whether the wheels have slid since the position was known."""
        return self.slid != Slid()

    def add(self, left: float, right: float, step: TurnStep, heading: float) -> None:
        """The wheels travelled `left` and `right` (m) while the robot turned by `step`; `heading`
        (rad): in the middle of it."""
        path = abs(left) + abs(right)
        self._left += left
        self._right += right
        self._path += path
        self.agreed_path += 0.5 * path
        self._x += path * cos(heading)
        self._y += path * sin(heading)
        self._by_gyro += step.angle
        self._seconds += step.seconds

    def find(self, left: WheelTravel, right: WheelTravel, bias_sd: float) -> Slide | None:
        """What the wheels have slid since the turns are compared, where these show it.

        They are compared anew after it. `bias_sd` of the gyro in rad/s.
        """
        by_wheels = (self._right - self._left) / self.track
        excess = by_wheels - self._by_gyro
        least = TURN_MIN + TURN_SHARE * abs(by_wheels)
        slide = None
        if abs(excess) > least and abs(excess) > least + TURN_SDS * self._sd(left, right, bias_sd):
            # An encoder that misses edges turns the robot less, and its wheel travels further.
            is_sure = not (left.fault_share or right.fault_share)
            slide = self._take(excess, is_sure)
        if slide is not None or self._path > 2.0 * PATH_MAX:
            self.compare_from_here()
        if slide is not None:
            self.agreed_path = self.agreed_turn = 0.0
        return slide

    def _sd(self, left: WheelTravel, right: WheelTravel, bias_sd: float) -> float:
        """Of the difference of both turns, rad, without slide."""
        travelled = (
            sum(
                (
                    wheel.variance + wheel.end_variance + wheel.disagreement
                    for wheel in (left, right)
                ),
                0.0,
            )
            + self.slip * self.slip * self._path
            + (left.fault_share * self._left) ** 2
            + (right.fault_share * self._right) ** 2
            + sum((self._turn_error(error) ** 2 for error in self.geometry), 0.0)
        )
        by_gyro = (self.scale_sd * self._by_gyro) ** 2 + (bias_sd * self._seconds) ** 2
        return sqrt(travelled / (self.track * self.track) + by_gyro)

    def _turn_error(self, error: GeometryDeviation) -> float:
        """Of the turn by the wheels, in m between them, where the geometry has this error."""
        both_wheels = error.right * self._right - error.left * self._left
        return both_wheels - error.track * (self._right - self._left)

    def _take(self, excess: float, is_sure: bool) -> Slide:
        """`is_sure`: that a wheel has travelled less than it turned."""
        right_slides = self._right * excess > 0.0
        left_slides = self._left * excess < 0.0
        length, headed = abs(excess) * self.track, hypot(self._x, self._y)
        # In a turn on the spot either wheel may slide, forward or backward; in a long one it did so
        # in an unknown direction.
        is_known = right_slides is not left_slides
        if not is_known or headed < HEADED_MIN * self._path:
            sd = 0.5 * length if right_slides or left_slides else length
            self.slid = self.slid._replace(around=self.slid.around + sd * sd)
            return Slide(excess, 0.0, 0.0)
        half = 0.5 * copysign(length, self._right if right_slides else self._left)
        share = half / headed
        x, y = share * self._x, share * self._y
        slide = Slide(excess, x, y) if is_sure else Slide(excess, 0.0, 0.0)
        before, sds = self.slid, 1.0 if is_sure else 2.0
        along = PoseDeviation(before.along.x + sds * x, before.along.y + sds * y)
        self.slid = Slid(before.x + slide.x, before.y + slide.y, along, before.around)
        return slide
