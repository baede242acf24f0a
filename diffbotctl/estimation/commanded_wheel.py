"""Travel of a wheel without an encoder: what a typical motor does with its commands.

Nothing measures the wheel, so the error of its speed does not average out: battery, friction and
the motor itself decide it. It is carried as a share of the travel, like that of missing edges.
"""

from __future__ import annotations

from math import pi

from diffbotctl.control.motor_curve import lagged_motion, settled_speed
from diffbotctl.estimation.wheel_frame import BoardFrame
from diffbotctl.estimation.wheel_side import LinkTiming, SideConfig

# Relative standard deviation of the speed. The motors of one kit differ by a tenth, a battery loses
# a fifth of its voltage while it empties, and breakaway duties differ by a factor of two.
SPEED_SD = 0.25
FAULT = "no encoder, its travel is estimated from the commands"


class CommandedWheelOdometer:
    """A wheel that follows its duty with the stated lag. `speed` in m/s."""

    end_variance = disagreement = variance = 0.0
    start_correction = added_variance = 0.0
    pushed_travel = 0.0
    fault_share = SPEED_SD
    fault = FAULT

    def __init__(self, side: SideConfig, time: int, count: int, timing: LinkTiming) -> None:
        """Start at rest at `time` (ns)."""
        self._motor, self._circumference = side.motor, pi * side.wheel.diameter
        self.pitch = self._circumference
        self.speed = self.travel = self._rolled = 0.0
        self._settled = 0.0  # m/s, with the command in effect
        self._time = time

    @property
    def coasting_travel(self) -> float:
        """m, without sign, that it travels until it rests when it is released now."""
        return abs(self.speed) * self._motor.lag

    def pose_is_set(self) -> None:
        """Nothing is remembered of the time before."""

    def update(self, frame: BoardFrame) -> None:
        last = min(frame.command_since, frame.time), frame.command
        for since, command in (last,) if frame.skipped is None else (frame.skipped, last):
            self._roll(since)
            self._settled = self._settled_speed(command, frame.is_duty)
        self._roll(frame.time)

    def _settled_speed(self, command: float, is_duty: bool) -> float:
        motor = self._motor
        speed = settled_speed(command, motor.loop.static, motor.rated) if is_duty else command
        return speed * self._circumference / (2.0 * pi)

    def _roll(self, until: int) -> None:
        """Roll until `until` (ns) with the command in effect."""
        span = (until - self._time) * 1e-9
        if span <= 0.0:
            return
        self.speed, travel = lagged_motion(self.speed, self._settled, self._motor.lag, span)
        self._rolled += travel
        self._time = until

    def unobserved_travel(self, count: int) -> float:
        """Metres during a gap in the telemetry: the board has stopped the motors."""
        return 0.0

    def report(self) -> None:
        """Set `travel` to its value since the last call."""
        self.travel, self._rolled = self._rolled, 0.0
