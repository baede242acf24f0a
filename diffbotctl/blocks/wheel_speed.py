"""Wheel speeds on the host, for boards that take only PWM: feed-forward and a slow integral."""

from __future__ import annotations

from collections import deque
from math import copysign, pi

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Duty, Encoders, Wheels
from diffbotctl.params import FromRobot, Param

MOST_INTEGRAL = 0.2  # duty; more than the spread of cold motors is never needed


class WheelSpeed(Block):
    """Turn wheel speeds into motor duty: friction's share, the speed's share, and what is missing.

    Twenty slots tell a speed only over a while, so the integral works on counts over `window`.
    """

    window = Param(
        float, default=0.6, unit="s", above=0.0, help="Time over which counts are taken."
    )
    integral = Param(float, default=0.01, minimum=0.0, help="Duty per rad of missing angle.")
    static: float = FromRobot("drive.left.motor.loop.static")
    rated: float = FromRobot("drive.left.motor.rated")
    slots: int = FromRobot("drive.left.encoder.slots")

    wheels = In(Wheels, fresh_for=0.3)
    encoders = In(Encoders, trigger=False)
    duty = Out(Duty)

    def reset(self) -> None:
        self.history: deque[tuple[int, int, int]] = deque()
        self.sums = [0.0, 0.0]
        self.targets = (0.0, 0.0)
        self.time = 0

    def react(self, now: int, wheels: Wheels | None, encoders: Encoders | None) -> Duty | None:
        if wheels is None:
            return Duty(now, 0.0, 0.0)
        step, self.time = (now - self.time) * 1e-9, now
        targets = (wheels.left, wheels.right)
        if not _alike(targets, self.targets):
            self.history.clear()
        self.targets = targets
        if encoders is not None:
            self._learn(encoders, targets, min(step, 0.1))
        left, right = (
            duty(target, total, self.static, self.rated)
            for target, total in zip(targets, self.sums, strict=True)
        )
        return Duty(now, left, right)

    def _learn(self, encoders: Encoders, targets: tuple[float, float], step: float) -> None:
        """Integrate the speed that is missing, once the window is full of steady driving."""
        self.history.append((encoders.time, encoders.left, encoders.right))
        first = self.history[0]
        span = (encoders.time - first[0]) * 1e-9
        if span < self.window:
            return
        self.history.popleft()
        pitch = 2 * pi / self.slots
        for side, target in enumerate(targets):
            counts = (encoders.left, encoders.right)[side] - first[1 + side]
            missing = abs(target) - abs(counts) * pitch / span
            total = self.sums[side] + self.integral * missing * step
            self.sums[side] = min(max(total, -MOST_INTEGRAL), MOST_INTEGRAL)


def _alike(these: tuple[float, float], those: tuple[float, float]) -> bool:
    """True when both wheels keep their direction and their speed within a tenth of a rad/s."""
    return all(a * b > 0 and abs(a - b) < 0.5 for a, b in zip(these, those, strict=True))


def duty(target: float, extra: float, static: float, rated: float) -> float:
    """Duty for `target` rad/s: dead band, slope to full duty at `rated`, and `extra`; 0 for 0."""
    if target == 0.0:
        return 0.0
    wanted = static + abs(target) / rated * (1.0 - static) + extra
    return copysign(min(max(wanted, 0.0), 1.0), target)
