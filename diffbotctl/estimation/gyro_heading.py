"""When the heading comes from the gyro, and when from the wheels."""

from __future__ import annotations

from math import degrees, sqrt

from diffbotctl.estimation.gyro_pose_filter import GyroPoseFilter
from diffbotctl.estimation.gyro_turn import GyroTurn
from diffbotctl.estimation.pose_filter import WheelTravel
from diffbotctl.messages import Encoders

SETTLED_NS = 300_000_000  # without edges and commands: the wheels stand
SCALE_SD = 0.03  # relative, of a gyro that was not calibrated (data sheet)


class GyroHeading:
    """Gives a pose filter the turns of a gyro, from the first standstill on, while it works.

    `news` are the events since they were taken, for the log.
    """

    def __init__(self, pose: GyroPoseFilter, scale: float) -> None:
        """`scale`: true turn divided by measured turn."""
        self.gyro = GyroTurn(scale)
        self.fault = ""
        self.news: list[str] = []
        self._pose = pose
        self._is_used = self._was_at_rest = self._slips = self._has_moved = False
        self._counts: tuple[int, int] | None = None
        self._still_since = 0

    @property
    def awaits_rest(self) -> bool:
        """True until the bias was measured at rest, or the robot moved or the gyro failed."""
        return not (self.gyro.is_zeroed or self._has_moved or self.fault)

    def restart(self) -> None:
        """The board has restarted: its sum begins again."""
        self.gyro.restart()
        self._is_used, self._counts, self._pose.step = False, None, None

    def take(self, encoders: Encoders, wheels: tuple[WheelTravel, WheelTravel]) -> None:
        """Set the turn of the pose filter's next move. `wheels`: as of the last move."""
        is_at_rest = self._is_at_rest(encoders)
        if encoders.turn_fault or (encoders.turn is None and self._is_used):
            self._fail(encoders.turn_fault or "the board reports no turn of the IMU")
        if encoders.turn is None or encoders.turn_fault:
            return
        self.fault = ""
        step, pose = self.gyro.update(encoders.time, encoders.turn, is_at_rest), self._pose
        if is_at_rest and not self._was_at_rest:
            pose.zeroed()
        if self._was_at_rest and not is_at_rest and self._is_used:
            self.news.append(f"IMU zeroed: {self.bias_text()}")
        self._was_at_rest = is_at_rest
        if not self._is_used and self.gyro.is_zeroed and is_at_rest and step is not None:
            pose.use_gyro(*wheels)
            self._is_used = True
            self.news.append(f"the heading comes from the IMU: {self.bias_text()}")
        pose.step = step if self._is_used else None
        pose.bias_sd = sqrt(self.gyro.variance)

    def moved(self, encoders: Encoders, wheels: tuple[WheelTravel, WheelTravel]) -> None:
        """The pose filter has moved; tell when the wheels slip."""
        self._pose.remember(encoders.time)
        slip = self._pose.slipped_turn(*wheels)
        if slip and not self._slips:
            self.news.append(
                f"the wheels slip: in half a second they turned {abs(degrees(slip)):.0f} deg "
                "further than the robot"
            )
        self._slips = bool(slip)

    def bias_text(self) -> str:
        """The bias with its standard deviation."""
        sd = sqrt(self.gyro.variance)
        return f"bias {degrees(self.gyro.bias):.3f} +- {degrees(sd):.3f} deg/s"

    def _fail(self, fault: str) -> None:
        self.gyro.restart()
        if self._is_used:
            self._pose.lose_gyro()
            self.news.append(f"{fault}; the heading comes from the wheels")
        self._is_used, self.fault, self._pose.step = False, fault, None

    def _is_at_rest(self, encoders: Encoders) -> bool:
        counts = (encoders.left, encoders.right)
        is_driven = encoders.left_command or encoders.right_command
        if counts != self._counts or is_driven:
            self._has_moved = self._has_moved or self._counts is not None
            self._counts, self._still_since = counts, encoders.time
        return encoders.time - self._still_since >= SETTLED_NS
