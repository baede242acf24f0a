"""Dead reckoning with a gyro: the wheels give the way, the gyro the turns, while it works.

The turn of a gyro has so little noise beside the slip of the wheels that the optimal weight of the
wheels' turn is zero. Its errors are its scale, which acts on every turn of the run, and its bias,
which acts on the time since the last standstill.
"""

from __future__ import annotations

from collections import deque
from math import cos, hypot, pi, sin, sqrt
from typing import Literal, NamedTuple

from diffbotctl.estimation.geometry_deviation import GeometryDeviation, PoseDeviation
from diffbotctl.estimation.gyro_turn import TurnStep
from diffbotctl.estimation.pose_filter import PoseFilter, WheelTravel, arc
from diffbotctl.estimation.pose_history import Correction
from diffbotctl.estimation.wheel_slide import Slid, WheelSlide
from diffbotctl.messages import Odometry

# A failure is noticed within this time, in which the turn was wrong. The wheels' turn replaces it;
# what may be left of the error is at least this.
UNNOTICED_NS = 500_000_000
FAILURE_HEADING_SD = 0.05  # rad
# The first turn of driven wheels, made within the time, shows how the gyro is mounted: of SIGN_TURN
# it measures more than the share, in the same direction or, all the time, about as much in the
# other one; of AXIS_TURN an axis across measures less than its share. A wheel that slides gives any
# ratio: of an IMU that was calibrated on this robot nothing is wrong but after AXIS_TURN.
SIGN_TURN, SIGN_SHARE = 20.0 * pi / 180.0, 0.5
OPPOSED_TURN, OPPOSED_SHARE = 8.0 * pi / 180.0, 0.3  # by which both sizes may differ
AXIS_TURN, AXIS_SHARE = 60.0 * pi / 180.0, 0.25
TURN_NS = 5_000_000_000
Mounting = Literal["unknown", "right", "opposed", "across"]


class _Moment(NamedTuple):
    """Where the robot was, the turns by wheels and gyro up to then (rad), and what had slid."""

    time: int
    x: float
    y: float
    by_wheels: float
    by_gyro: float
    slid: Slid


class GyroPoseFilter(PoseFilter):
    """A PoseFilter that takes its turns from `step` unless that is None.

    `bias_sd` (rad/s) is that of the gyro at present.
    """

    def __init__(
        self,
        track: float,
        slip: float,
        geometry: tuple[GeometryDeviation, ...],
        scale_sd: float,
        is_calibrated: bool = False,
    ) -> None:
        """As PoseFilter; `scale_sd`: relative standard deviation of the gyro's scale.

        `is_calibrated`: it has measured turns of this robot, so that its axis is right.
        """
        self._is_calibrated = is_calibrated
        self._opposed_turn = AXIS_TURN if is_calibrated else SIGN_TURN
        self.step: TurnStep | None = None
        self.bias_sd = 0.0
        self.scale_sd = scale_sd
        self._of_scale = self._of_bias = PoseDeviation()
        self._moments: deque[_Moment] = deque()
        self._by_wheels = self._by_gyro = 0.0
        self.mounting: Mounting = "unknown"
        self._compared: _Moment | None = None  # from which on both turns are compared
        self._may_be_opposed = True  # as of all moments since then
        self.slide = WheelSlide(track, slip, geometry, scale_sd)
        super().__init__(track, slip, geometry)

    @property
    def is_wrong(self) -> bool:
        """Whether the gyro is not mounted as the robot file states."""
        return self.mounting in ("opposed", "across")

    def set_pose(self, x: float, y: float, heading: float) -> None:
        """As PoseFilter: the pose is known exactly."""
        super().set_pose(x, y, heading)
        self._of_scale = self._of_bias = PoseDeviation()
        self._moments.clear()
        self._compared = None
        self.slide.forget()

    def correct_bias(self, error: float) -> None:
        """The bias (rad/s) was larger by `error` since it was measured last."""
        of_bias = self._of_bias
        self.x -= error * of_bias.x
        self.y -= error * of_bias.y
        self.heading -= error * of_bias.heading

    def zeroed(self) -> None:
        """The robot moves with a bias that was measured anew: the error of the last one stays."""
        self._add_deviation(self._of_bias, self.bias_sd)
        self._of_bias = PoseDeviation()

    def use_gyro(self, left: WheelTravel, right: WheelTravel) -> None:
        """Take the turns from the gyro from now on; the wheels' error of the heading stays."""
        variance = (left.variance + right.variance) / self.track**2
        self._turn_about((self.start_x, self.start_y), variance)

    def lose_gyro(self) -> None:
        """Take the turns from the wheels, also those of the time in which the gyro failed."""
        self.zeroed()
        self.step = None
        x, y, correction = self.x, self.y, 0.0
        before = self._compared if self.is_wrong else next(iter(self._moments), None)
        if before is not None:
            x, y, correction = before.x, before.y, self._excess(before)
            self._take_back(before.slid)
        half = 0.5 * correction  # the wrong turn grew from zero on the way from there
        ahead, aside = self.x - x, self.y - y
        self.x = x + ahead * cos(half) - aside * sin(half)
        self.y = y + ahead * sin(half) + aside * cos(half)
        self.heading += correction
        sd = max(FAILURE_HEADING_SD, 0.0 if self.mounting == "opposed" else abs(half))
        self._turn_about((x, y), sd * sd)
        self._moments.clear()
        self._compared = None
        self.start()

    def _take_back(self, before: Slid) -> None:
        """Take back what seems to have slid since `before`: it was the failure."""
        self.x += self.slide.slid.x - before.x
        self.y += self.slide.slid.y - before.y
        self.slide.slid = before
        self.slide.compare_from_here()

    def remember(self, time: int) -> None:
        """Note the pose at `time` (ns) for a failure that is noticed later."""
        self._moments.append(
            _Moment(time, self.x, self.y, self._by_wheels, self._by_gyro, self.slide.slid)
        )
        while time - self._moments[0].time > UNNOTICED_NS:
            self._moments.popleft()

    def compare_turns(self, is_driven: bool) -> None:
        """Find out from the turns up to the last moment how the gyro is mounted, in `mounting`."""
        if self.mounting != "unknown" or self.step is None or not self._moments:
            return
        now, before = self._moments[-1], self._compared
        if before is None or not is_driven or now.time - before.time > TURN_NS:
            self._compared, self._may_be_opposed = now, True
            return
        by_wheels, by_gyro = now.by_wheels - before.by_wheels, now.by_gyro - before.by_gyro
        difference_max = OPPOSED_TURN + OPPOSED_SHARE * abs(by_wheels)
        self._may_be_opposed &= abs(by_wheels + by_gyro) < difference_max
        self.mounting = self._mounting_by(by_wheels, by_gyro)

    def _mounting_by(self, by_wheels: float, by_gyro: float) -> Mounting:
        """What both turns (rad) show."""
        if abs(by_wheels) < SIGN_TURN:
            return "unknown"
        if abs(by_gyro) > SIGN_SHARE * abs(by_wheels):
            if by_gyro * by_wheels > 0.0:
                return "right"
            if self._may_be_opposed and abs(by_wheels) >= self._opposed_turn:
                return "opposed"
        if abs(by_wheels) < AXIS_TURN:
            return "unknown"
        is_across = abs(by_gyro) < AXIS_SHARE * abs(by_wheels)
        return "across" if is_across and not self._is_calibrated else "right"

    def find_slide(self, left: WheelTravel, right: WheelTravel) -> float:
        """Take what the wheels have slid from the way. Returns the turn (rad) by which they exceed
        the gyro, where they have; otherwise 0."""
        slide = self.slide.find(left, right, self.bias_sd)
        if slide is None:
            return 0.0
        self.x -= slide.x
        self.y -= slide.y
        return slide.turn

    def _excess(self, before: _Moment) -> float:
        """Turn (rad) of the wheels since `before`, less that of the gyro."""
        return (self._by_wheels - before.by_wheels) - (self._by_gyro - before.by_gyro)

    def message(
        self, time: int, left: WheelTravel, right: WheelTravel, warning: str = ""
    ) -> Odometry:
        """As PoseFilter, with the errors of the gyro and what the wheels have slid."""
        message = super().message(time, left, right, warning)
        covariance = message.covariance
        _, _, along, around = self.slide.slid
        for deviation, sd in (
            (self._of_scale, self.scale_sd),
            (self._of_bias, self.bias_sd),
            (along, 1.0),
        ):
            added = _products(deviation, sd)
            covariance = tuple(a + b for a, b in zip(covariance, added, strict=True))  # type: ignore[assignment]
        if around:
            xx, xy, xh, yy, yh, hh = covariance
            covariance = (xx + around, xy, xh, yy + around, yh, hh)
        # A scale that is not calibrated is as little known as the geometry by a ruler.
        of_scale = 0.0 if self._is_calibrated else self.scale_sd * self._of_scale.heading
        heading_sd = hypot(message.geometry_heading_sd, of_scale)
        return message._replace(covariance=covariance, geometry_heading_sd=heading_sd)

    def _heading_variance(self, variance: float) -> float:
        return super()._heading_variance(variance) if self.step is None else 0.0

    def _correction(self, left: float, right: float) -> Correction:
        ahead, turn = super()._correction(left, right)
        return ahead, turn if self.step is None else 0.0

    def _roll(self, left: float, right: float, left_variance: float, right_variance: float) -> None:
        step, track = self.step, self.track
        if step is None:
            super()._roll(left, right, left_variance, right_variance)
            return
        self._by_wheels += (right - left) / track
        self._by_gyro += step.angle
        middle = self.heading + 0.5 * step.angle
        direction, ahead = (cos(middle), sin(middle)), 0.5 * (left + right)
        self.slide.add(left, right, step, middle)
        along = 0.25 * (left_variance + right_variance)
        self._propagate(ahead, along, step.variance, direction)
        of_track, of_left, of_right = self.unit_effects
        self.unit_effects = (
            of_track.advanced(0.0, 0.0, ahead, track, direction),
            of_left.advanced(0.0, left, ahead, track, direction),
            of_right.advanced(0.0, right, ahead, track, direction),
        )
        turned, waited = step.angle * track, step.seconds * track
        self._of_scale = self._of_scale.advanced(turned, 0.0, ahead, track, direction)
        self._of_bias = self._of_bias.advanced(waited, 0.0, ahead, track, direction)
        half = 0.5 * step.angle * track
        self.x, self.y, self.heading = arc(
            self.x, self.y, self.heading, ahead - half, ahead + half, track
        )

    def _add_deviation(self, deviation: PoseDeviation, sd: float) -> None:
        xx, xy, xh, yy, yh, hh = _products(deviation, sd)
        self._add(xx, xy, xh, yy, yh, hh)

    def _turn_about(self, origin: tuple[float, float], variance: float) -> None:
        """Add an error of the heading (variance, rad2) since the robot was at `origin` (m)."""
        lever = PoseDeviation(origin[1] - self.y, self.x - origin[0], 1.0)
        self._add_deviation(lever, sqrt(variance))

    def _add(self, *added: float) -> None:
        xx, xy, xh, yy, yh, hh = (a + b for a, b in zip(self.slip_covariance, added, strict=True))
        self.slip_covariance = (xx, xy, xh, yy, yh, hh)


def _products(
    deviation: PoseDeviation, sd: float
) -> tuple[float, float, float, float, float, float]:
    """Covariance by an error with this `sd`; `deviation`: of the pose, for an error of 1."""
    x, y, heading = sd * deviation.x, sd * deviation.y, sd * deviation.heading
    return (x * x, x * y, x * heading, y * y, y * heading, heading * heading)
