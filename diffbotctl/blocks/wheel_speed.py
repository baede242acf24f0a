"""Wheel-speed control on the host, for boards that take only a duty."""

from __future__ import annotations

from collections import deque
from math import pi

from diffbotctl.block import Block, In, Out
from diffbotctl.control.speed_loop import (
    MotorSettings,
    SpeedGains,
    limit_duty,
    limit_integral,
    speed_gains,
)
from diffbotctl.estimation.wheel_side import SideConfig
from diffbotctl.messages import Duty, Encoders, Wheels
from diffbotctl.params import FromRobot, Param

INTEGRAL_MAX = 0.2  # duty; covers the spread of cold motors
LEARNING_STEP_MAX_S = 0.1
SPEED_CHANGE_MAX = 0.5  # rad/s; a larger change of the target restarts the window
# A wheel that should have given an edge, and has not, is not turning: static friction holds it. Its
# duty then rises, and falls to the feed-forward at the first edge. The delay is that of a command
# and its telemetry, and the time in which a geared motor starts; the largest distance from rest to
# the first edge is one pitch.
OVERDUE_PITCHES, OVERDUE_DELAY_S = 1.2, 0.4
KICK_RATE = 0.3  # duty per s: slow against the delay, after which the edge is known
KICK_MAX = 0.3  # duty; a wheel whose encoder is dead must not race
KICK_SHARE = 0.5  # of it that the integral keeps at the first edge


class WheelSpeed(Block):
    """Convert wheel speeds into motor duty: feed-forward of each motor plus an integral.

    With 20 slots the speed is measured over a long time, so the integral uses counts over `window`.
    The duty of a wheel that gives no edges rises until it turns, by at most 0.3.
    """

    window = Param(
        float, default=0.6, unit="s", above=0.0, help="Time over which the speed is measured."
    )
    integral = Param(float, default=0.01, minimum=0.0, help="Duty per rad of angle error.")
    left_side: SideConfig = FromRobot("drive.left")
    right_side: SideConfig = FromRobot("drive.right")

    wheels = In(Wheels, fresh_for=0.3)
    encoders = In(Encoders, trigger=False)
    duty = Out(Duty)

    def reset(self) -> None:
        self.history: deque[tuple[int, int, int]] = deque()
        self.integrals = [0.0, 0.0]  # duty, in the direction of the target
        self.targets = (0.0, 0.0)
        self.time = 0
        self.counts: tuple[int, int] | None = None
        self.overdue = [0.0, 0.0]  # rad that should have turned since the last edge or reversal
        self.kicks = [0.0, 0.0]  # duty, in the direction of the target

    def react(self, now: int, wheels: Wheels | None, encoders: Encoders | None) -> Duty | None:
        if wheels is None:
            return Duty(now, 0.0, 0.0)
        step, self.time = (now - self.time) * 1e-9, now
        targets = (wheels.left, wheels.right)
        if not _is_steady(targets, self.targets):
            self.history.clear()
        if encoders is not None and self.left_side.encoder.channels:
            step = min(step, LEARNING_STEP_MAX_S)
            self._kick(encoders, targets, step)
            self._learn(encoders, targets, step)
        self.targets = targets
        left, right = (
            integral + kick for integral, kick in zip(self.integrals, self.kicks, strict=True)
        )
        return Duty(
            now,
            duty(wheels.left, left, self.left_side.motor),
            duty(wheels.right, right, self.right_side.motor),
        )

    def _kick(self, encoders: Encoders, targets: tuple[float, float], step: float) -> None:
        """Raise the duty of a wheel whose edge is overdue."""
        counts, self.counts = self.counts or (0, 0), (encoders.left, encoders.right)
        per_turn = (self.left_side.encoder.counts, self.right_side.encoder.counts)
        for side, target in enumerate(targets):
            if counts[side] != self.counts[side] or target * self.targets[side] <= 0.0:
                kept = 0.0 if target * self.targets[side] <= 0.0 else KICK_SHARE * self.kicks[side]
                self.integrals[side] = limit_integral(self.integrals[side] + kept, INTEGRAL_MAX)
                self.overdue[side] = self.kicks[side] = 0.0
                continue
            self.overdue[side] += abs(target) * step
            allowed = OVERDUE_PITCHES * 2 * pi / per_turn[side] + OVERDUE_DELAY_S * abs(target)
            if self.overdue[side] > allowed:
                self.kicks[side] = min(self.kicks[side] + KICK_RATE * step, KICK_MAX)

    def _learn(self, encoders: Encoders, targets: tuple[float, float], step: float) -> None:
        """Integrate the speed error, once the targets have been steady for `window`."""
        self.history.append((encoders.time, encoders.left, encoders.right))
        first_time, *first_counts = self.history[0]
        span = (encoders.time - first_time) * 1e-9
        if span < self.window:
            return
        self.history.popleft()
        counts = (encoders.left - first_counts[0], encoders.right - first_counts[1])
        per_turn = (self.left_side.encoder.counts, self.right_side.encoder.counts)
        for side, target in enumerate(targets):
            pitch = 2 * pi / per_turn[side]
            missing = abs(target) - abs(counts[side]) * pitch / span
            integral = self.integrals[side] + self.integral * missing * step
            self.integrals[side] = limit_integral(integral, INTEGRAL_MAX)


def _is_steady(targets: tuple[float, float], before: tuple[float, float]) -> bool:
    """True when both targets keep their direction and nearly their speed."""
    return all(
        a * b > 0 and abs(a - b) < SPEED_CHANGE_MAX for a, b in zip(targets, before, strict=True)
    )


def duty(target: float, integral: float, motor: MotorSettings) -> float:
    """Duty for `target` (rad/s): feed-forward plus `integral` (duty, in the target's direction).

    0 for target 0.
    """
    signed_integral = integral if target > 0.0 else -integral
    relative = target / motor.rated
    return limit_duty(_relative_gains(motor).duty(relative, integral=signed_integral), target)


def _relative_gains(motor: MotorSettings) -> SpeedGains:
    """Gains for speeds in units of the rated speed.

    The rounding of this form keeps the replay of version 0.1 recordings bit-identical.
    """
    gains, loop = speed_gains(motor), motor.loop
    slope = 1.0 - loop.static if loop.speed is None else loop.speed * motor.rated
    return gains._replace(slope=slope)
