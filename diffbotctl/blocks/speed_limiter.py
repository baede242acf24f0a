"""Limit the commanded velocity and its rate of change."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.control.velocity_limits import VelocityRate, brake_limited
from diffbotctl.messages import Twist
from diffbotctl.params import FromRobot, Param


class SpeedLimiter(Block):
    """Limit speed, turn rate, acceleration and braking of a body velocity.

    A twist that is too fast is scaled as a whole, which keeps its curvature. Times are those of the
    messages; after `silence` it starts from rest, as the board has stopped by then. A twist of zero
    after which nothing comes is not ramped for longer than `zero_after`: then the output is zero.
    """

    silence = Param(
        float, default=0.3, unit="s", above=0.0, help="Without input for longer, start from rest."
    )
    first_step = Param(
        float, default=0.02, unit="s", above=0.0, help="Time step assumed for the first twist."
    )
    zero_after = Param(
        float,
        default=0.05,
        unit="s",
        above=0.0,
        maximum=0.2,
        help="Time after a twist of zero at which its ramp ends, unless another twist comes.",
    )
    speed: float = FromRobot("limits.speed")
    turn_rate: float = FromRobot("limits.turn_rate")
    acceleration: float = FromRobot("limits.acceleration")
    braking: float = FromRobot("limits.braking")
    track: float = FromRobot("drive.track")
    twist = In(Twist, fresh_for="zero_after")
    limited = Out(Twist, name="twist")

    def reset(self) -> None:
        self.time: int | None = None
        self.linear = self.angular = 0.0
        self.is_stopping = False  # a twist of zero was the last one

    def react(self, now: int, twist: Twist | None) -> Twist | None:
        if twist is None:
            return self._stopped(now)
        self.is_stopping = twist.linear == 0.0 == twist.angular
        step = self.first_step if self.time is None else (twist.time - self.time) * 1e-9
        if self.time is None or step > self.silence:
            self.linear = self.angular = 0.0
            step = self.first_step
        self.time = twist.time
        linear, angular = brake_limited(twist.linear, twist.angular, self.speed, self.turn_rate)
        rate = VelocityRate(self.acceleration, self.braking, self.track)
        before = self.linear, self.angular
        self.linear, self.angular = rate.limited(before, (linear, angular), step)
        return Twist(twist.time, self.linear, self.angular)

    def _stopped(self, now: int) -> Twist | None:
        """Zero where a ramp towards zero is left without twists, else nothing."""
        if not self.is_stopping or (self.linear == 0.0 == self.angular):
            return None
        self.linear = self.angular = 0.0
        return Twist(now, 0.0, 0.0)
