"""Dead reckoning with a gyro: the wheels give the way, both together the turns, while it works."""

from __future__ import annotations

from collections import deque
from math import cos, pi, radians, sin, sqrt
from typing import Literal, NamedTuple

from diffbotctl.estimation.geometry_deviation import GeometryDeviation, PoseDeviation
from diffbotctl.estimation.gyro_turn import TurnStep
from diffbotctl.estimation.pose_filter import Correction, PoseFilter, WheelTravel, arc
from diffbotctl.estimation.turn_fusion import BIAS, TurnFusion
from diffbotctl.messages import Odometry, PoseCovariance

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
# s; standard deviation of the time between both turns: a gyro filters its rate, and the board sums
# it ten milliseconds apart.
TURN_TIME_SD = 0.015
# m of a wheel, within which the errors of its place in a slot are the same; and the least
# standard deviation of a comparison.
PLACE_TRAVEL, COMPARED_SD = 0.05, radians(0.05)
SLID_TURN_MIN = radians(2.0)  # that is reported
Mounting = Literal["unknown", "right", "opposed", "across"]


class _Moment(NamedTuple):
    """Where the robot was, and the turns by wheels and gyro up to then (rad)."""

    time: int
    x: float
    y: float
    heading: float
    by_wheels: float
    by_gyro: float


class GyroPoseFilter(PoseFilter):
    """A PoseFilter that takes its turns from wheels and gyro where `step` is not None.

    `agreed_path` (m, of the axle) and `agreed_turn` (rad): on which both turns have agreed since
    the wheels have slid last. An encoder that counts half of its edges makes them differ.
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
        self.fusion = TurnFusion(geometry, scale_sd, is_calibrated)
        self._turned = self._random_variance = self._scale_turn_sd = 0.0  # of the fusion, so far
        self._of_scale = self._of_slide = PoseDeviation()
        self.slid_turn = 0.0
        """rad, of all slides since the pose was set"""
        self.agreed_path = self.agreed_turn = 0.0
        self._wheel_variance = 0.0  # m2, of the places of both wheels
        self._moments: deque[_Moment] = deque()
        self._by_wheels = self._by_gyro = 0.0
        self.mounting: Mounting = "unknown"
        self._compared: _Moment | None = None  # from which on both turns are compared
        self._may_be_opposed = True  # as of all moments since then
        super().__init__(track, slip, geometry)

    @property
    def is_wrong(self) -> bool:
        """Whether the gyro is not mounted as the robot file states."""
        return self.mounting in ("opposed", "across")

    @property
    def has_slid(self) -> bool:
        """Whether the wheels have slid since the pose was set."""
        return self.slid_turn > SLID_TURN_MIN

    def set_pose(self, x: float, y: float, heading: float) -> None:
        """As PoseFilter: the pose is known exactly."""
        super().set_pose(x, y, heading)
        self._of_scale = self._of_slide = PoseDeviation()
        self.slid_turn = 0.0
        self._moments.clear()
        self._compared = None
        self._start_fusion(self.fusion.covariance[BIAS][BIAS], 0.0)

    def zeroed(self, error: float, variance: float) -> None:
        """The bias was measured at rest: it was wrong by `error` (rad/s)."""
        self.fusion.bias_measured(error, variance)

    def use_gyro(self, left: WheelTravel, right: WheelTravel, bias_variance: float) -> None:
        """Take the turns from both from now on; the wheels' error of the heading stays."""
        variance = (left.variance + right.variance) / self.track**2
        self._turn_about((self.start_x, self.start_y), variance)
        self._start_fusion(bias_variance, variance)

    def _start_fusion(self, bias_variance: float, wheels_variance: float) -> None:
        self.fusion.start(bias_variance, wheels_variance)
        self._turned = self._random_variance = self._scale_turn_sd = 0.0

    def lose_gyro(self) -> None:
        """Take the turns from the wheels, also those of the time in which the gyro failed."""
        self.step = None
        before = self._compared if self.is_wrong else next(iter(self._moments), None)
        x, y, correction = self.x, self.y, 0.0
        if before is not None:
            x, y = before.x, before.y
            correction = before.heading + (self._by_wheels - before.by_wheels) - self.heading
        half = 0.5 * correction  # the wrong turn grew from zero on the way from there
        ahead, aside = self.x - x, self.y - y
        self.x = x + ahead * cos(half) - aside * sin(half)
        self.y = y + ahead * sin(half) + aside * cos(half)
        self.heading += correction
        sd = max(FAILURE_HEADING_SD, 0.0 if self.mounting == "opposed" else abs(half))
        self._turn_about((x, y), sd * sd)
        self.slid_turn, self._of_slide = 0.0, PoseDeviation()  # what seemed to slide did not
        self._moments.clear()
        self._compared = None
        self.start()

    def remember(self, time: int) -> None:
        """Note the pose at `time` (ns) for a failure that is noticed later."""
        self._moments.append(
            _Moment(time, self.x, self.y, self.heading, self._by_wheels, self._by_gyro)
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

    def move(self, left: WheelTravel, right: WheelTravel) -> None:
        """Advance by the travel of both wheels since the previous frame."""
        wheels = (left, right)
        self._wheel_variance = sum(
            (each.variance + each.end_variance + each.disagreement for each in wheels), 0.0
        )
        super().move(left, right)

    def message(
        self, time: int, left: WheelTravel, right: WheelTravel, warning: str = ""
    ) -> Odometry:
        """As PoseFilter, with the errors of the turns and what the wheels have slid."""
        message = super().message(time, left, right, warning)
        covariance = message.covariance
        for deviation in (self._of_scale, self._of_slide):
            added = _products(deviation, 1.0)
            covariance = tuple(a + b for a, b in zip(covariance, added, strict=True))  # type: ignore[assignment]
        # A scale that is not calibrated is as little known as the geometry by a ruler.
        x, y, heading = PoseDeviation() if self._is_calibrated else self._of_scale
        return message._replace(
            covariance=covariance,
            geometry_sd=sqrt(message.geometry_sd**2 + x * x + y * y),
            geometry_heading_sd=sqrt(message.geometry_heading_sd**2 + heading * heading),
        )

    def _heading_variance(self, variance: float) -> float:
        return super()._heading_variance(variance) if self.step is None else 0.0

    def _correction(self, left: float, right: float) -> Correction:
        ahead, turn = super()._correction(left, right)
        if self.step is not None:
            self.fusion.by_wheels += turn
        return ahead, turn if self.step is None else 0.0

    def _roll(self, left: float, right: float, left_variance: float, right_variance: float) -> None:
        step, track, fusion = self.step, self.track, self.fusion
        if step is None:
            super()._roll(left, right, left_variance, right_variance)
            return
        by_wheels, ahead = (right - left) / track, 0.5 * (left + right)
        self._by_wheels += by_wheels
        self._by_gyro += step.angle
        wheels_variance = (left_variance + right_variance) / (track * track)
        fusion.add(by_wheels, ahead / track, step, wheels_variance)
        self._compare(abs(left) + abs(right), step)
        turn, self._turned = fusion.turn - self._turned, fusion.turn
        middle = self.heading + 0.5 * turn
        direction = cos(middle), sin(middle)
        self._propagate_turn(ahead, 0.25 * (left_variance + right_variance), direction)
        of_track, of_left, of_right = self.unit_effects
        # Turns that are right by the wheels have the errors of their geometry.
        wider = turn * track if fusion.wheels_are_reference else 0.0
        self.unit_effects = (
            of_track.advanced(-wider, 0.0, ahead, track, direction),
            of_left.advanced(0.5 * wider, left, ahead, track, direction),
            of_right.advanced(0.5 * wider, right, ahead, track, direction),
        )
        half = 0.5 * turn * track
        self.x, self.y, self.heading = arc(
            self.x, self.y, self.heading, ahead - half, ahead + half, track
        )

    def _compare(self, path: float, step: TurnStep) -> None:
        """Compare both turns after a `path` (m) of both wheels and a `step` of the gyro."""
        turn = abs(step.angle)
        self.agreed_path += 0.5 * path
        self.agreed_turn += turn
        moved = path + turn * self.track
        if not moved:
            return
        variance = self._wheel_variance / (self.track * self.track) + COMPARED_SD * COMPARED_SD
        if step.seconds:
            variance += (TURN_TIME_SD * turn / step.seconds) ** 2
        slid = self.fusion.compare(variance, min(0.5 * moved / PLACE_TRAVEL, 1.0))
        if slid:
            self.slid_turn += abs(slid)
            self.agreed_path = self.agreed_turn = 0.0
            # A wheel that slides travels less than it turns, and the axle lacks half of that.
            lacking = 0.5 * abs(slid) * self.track
            x, y, _ = self._of_slide
            self._of_slide = PoseDeviation(
                x + lacking * cos(self.heading), y + lacking * sin(self.heading)
            )

    def _propagate_turn(self, ahead: float, along: float, direction: tuple[float, float]) -> None:
        """Move the covariance on; what is new of the variance of the turn is random, but for the
        part of the scale, which grows with the turn."""
        fusion, before = self.fusion, self._scale_turn_sd
        self._scale_turn_sd = scale_sd = fusion.scale_sd
        random_variance = max(fusion.variance - scale_sd * scale_sd, 0.0)
        grown = max(random_variance - self._random_variance, 0.0)
        self._random_variance = max(random_variance, self._random_variance)
        self._propagate(ahead, along, grown, direction)
        wider = (scale_sd - before) * self.track
        self._of_scale = self._of_scale.advanced(wider, 0.0, ahead, self.track, direction)

    def _turn_about(self, origin: tuple[float, float], variance: float) -> None:
        """Add an error of the heading (variance, rad2) since the robot was at `origin` (m)."""
        lever = PoseDeviation(origin[1] - self.y, self.x - origin[0], 1.0)
        added = _products(lever, sqrt(variance))
        xx, xy, xh, yy, yh, hh = (a + b for a, b in zip(self.slip_covariance, added, strict=True))
        self.slip_covariance = (xx, xy, xh, yy, yh, hh)


def _products(deviation: PoseDeviation, sd: float) -> PoseCovariance:
    """Covariance by an error with this `sd`; `deviation`: of the pose, for an error of 1."""
    x, y, heading = sd * deviation.x, sd * deviation.y, sd * deviation.heading
    return (x * x, x * y, x * heading, y * y, y * heading, heading * heading)
