"""When the heading comes from the gyro, and when from the wheels."""

from __future__ import annotations

from math import degrees, sqrt

from diffbotctl.estimation.gyro_pose_filter import GyroPoseFilter
from diffbotctl.estimation.gyro_turn import GyroTurn
from diffbotctl.estimation.pose_filter import WheelTravel
from diffbotctl.messages import Encoders, Imu, ImuState

# Time without edges and commands after which the wheels stand. With few slots they creep on unseen,
# for about four lags of their motors.
SETTLED_NS, SETTLED_COARSE_NS = 60_000_000, 350_000_000
# Of a robot that trembles or is pushed: after it odometry begins without the gyro.
WAITING_MAX_NS = 12_000_000_000
SCALE_SD = 0.03  # relative, of a gyro that was not calibrated (data sheet)
MOUNTING_FAULTS = {
    "opposed": "the IMU measures turns with the wrong sign: it is not mounted as `axes` states, or "
    "the motors turn the wrong way; run `diffbotctl calibrate imu`",
    "across": "the IMU measured nearly nothing of a turn of the wheels: it is not mounted as "
    "`axes` states, or the wheels slip; run `diffbotctl calibrate imu`",
}
UNPROVEN = ", or the IMU is not mounted as `axes` states"
SLID = "the wheels have slid on the floor"
UNUSED = "the heading comes from the wheels: the robot did not stand still long enough for the IMU"


class GyroHeading:
    """Gives a pose filter the turns of a gyro, from the first standstill on, while it works.

    `news` are the events since they were taken, for the log.
    """

    def __init__(self, pose: GyroPoseFilter, scale: float, has_fine_encoders: bool) -> None:
        """`scale`: true turn divided by measured turn."""
        self._settled = SETTLED_NS if has_fine_encoders else SETTLED_COARSE_NS
        self.gyro = GyroTurn(scale)
        self.fault = ""
        self.news: list[str] = []
        self._pose = pose
        self._was_at_rest = self._has_begun = False
        self._waiting_since: int | None = None  # ns
        self._was_sliding = False
        self.is_used = False
        """whether the heading comes from the gyro"""
        self._counts: tuple[int, int] | None = None
        self._still_since = 0
        self._used_bias = 0.0  # rad/s, as the robot left its last rest

    @property
    def awaits_rest(self) -> bool:
        """True until the bias was measured at rest, or the robot was driven or the gyro failed."""
        return not (self.gyro.is_zeroed or self._has_begun or self.fault)

    @property
    def warning(self) -> str:
        """Why the pose is less accurate than usual; empty when it is not."""
        if self.fault:
            return self.fault
        if self._has_begun and not self.is_used:
            return UNUSED
        return SLID if self._pose.has_slid else ""

    def restart(self) -> None:
        """The board has restarted: its sum begins again."""
        self.gyro.restart()
        self.is_used, self._counts, self._pose.step = False, None, None

    def take(self, encoders: Encoders, wheels: tuple[WheelTravel, WheelTravel]) -> None:
        """Set the turn of the pose filter's next move. `wheels`: as of the last move."""
        is_at_rest = self._is_at_rest(encoders)
        if self._pose.is_wrong:
            return
        if encoders.turn_fault or (encoders.turn is None and self.is_used):
            self._fail(encoders.turn_fault or "the board reports no turn of the IMU")
        if encoders.turn is None or encoders.turn_fault:
            return
        self.fault = ""
        pose = self._pose
        step = self.gyro.update(encoders.time, encoders.turn, is_at_rest)
        if self._was_at_rest and not is_at_rest:
            self._leave_rest()
        self._was_at_rest = is_at_rest
        if not self.is_used and self.gyro.is_zeroed and is_at_rest and step is not None:
            pose.use_gyro(*wheels, self.gyro.variance)
            self.is_used, self._used_bias = True, self.gyro.bias
            self.news.append(f"the heading comes from the IMU: {self.bias_text()}")
        pose.step = step if self.is_used else None

    def _leave_rest(self) -> None:
        if self.is_used:
            self._pose.zeroed(self.gyro.bias - self._used_bias, self.gyro.variance)
            self._used_bias = self.gyro.bias
            self.news.append(f"IMU zeroed: {self.bias_text()}")

    def moved(self, encoders: Encoders, wheels: tuple[WheelTravel, WheelTravel]) -> None:
        """The pose filter has moved; tell when the wheels slide, or the gyro is mounted wrongly."""
        self._pose.remember(encoders.time)
        self._pose.compare_turns(bool(encoders.left_command or encoders.right_command))
        if self._pose.is_wrong and self.is_used:
            self._fail(MOUNTING_FAULTS[self._pose.mounting])
        if self._pose.has_slid and not self._was_sliding:
            differ = (
                f"the turns by wheels and IMU differ by {degrees(self._pose.slid_turn):.0f} deg"
            )
            unproven = UNPROVEN if self._pose.mounting == "unknown" else ""
            self.news.append(f"{differ}: the wheels slide on the floor{unproven}")
        self._was_sliding = self._pose.has_slid

    def bias_text(self) -> str:
        sd = sqrt(self.gyro.variance)
        return f"bias {degrees(self.gyro.bias):.3f} +- {degrees(sd):.3f} deg/s"

    def message(self, time: int, is_calibrated: bool) -> Imu:
        """What the gyro shows at `time` (ns); `is_calibrated`: its scale is."""
        step, rate = self._pose.step, 0.0
        state: ImuState = "failed" if self.fault else "zeroing"
        if self.is_used:
            state = "working"
            if step is not None and step.seconds:
                rate = step.angle / step.seconds
        bias, sd = self.gyro.bias, sqrt(self.gyro.variance)
        return Imu(time, state, rate, bias, sd, is_calibrated, self.fault)

    def _fail(self, fault: str) -> None:
        self.gyro.restart()
        if self.is_used:
            self._pose.lose_gyro()
            self.news.append(f"{fault}; the heading comes from the wheels")
        self.is_used, self.fault, self._pose.step = False, fault, None

    def _is_at_rest(self, encoders: Encoders) -> bool:
        counts = (encoders.left, encoders.right)
        is_driven = bool(encoders.left_command or encoders.right_command)
        if counts != self._counts or is_driven:
            self._counts, self._still_since = counts, encoders.time
            self._has_begun = self._has_begun or is_driven
        if self._waiting_since is None:
            self._waiting_since = encoders.time
        if encoders.time - self._waiting_since > WAITING_MAX_NS:
            self._has_begun = True
        return encoders.time - self._still_since >= self._settled
