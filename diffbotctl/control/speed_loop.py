"""The wheel-speed loop of a board with our firmware, in floating point.

The same specification stands in the C source: feed-forward with dead band, PI on the speed that the
edges tell, at 100 Hz. Speeds are rad/s, duty -1 to 1, times integer nanoseconds.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple, Protocol

TICK = 10_000_000  # ns between two runs of the loop
TICK_SECONDS = 0.010
SILENCE = 300_000_000  # ns without an edge after which the speed counts as unknown
MOST_INTEGRAL = 0.25  # duty; more than the spread of cold motors is never needed
SLEW = 0.05  # duty per tick while a reversal is under way, so that no gear is slammed
STALL_DUTY, STALL_TIME = 0.3, 500_000_000  # duty above which a wheel must give edges, and for ns


class SpeedGains(NamedTuple):
    """Settings of the loop: feed-forward `static` (duty) and `slope` (duty per rad/s), PI gains."""

    static: float
    slope: float
    proportional: float  # duty per rad/s
    integral: float  # duty per rad


class SpeedLoopSettings(Protocol):
    """The robot file's `loop` of a motor. `speed`: duty per rad/s; None: from the rated speed."""

    @property
    def static(self) -> float: ...
    @property
    def speed(self) -> float | None: ...
    @property
    def proportional(self) -> float: ...
    @property
    def integral(self) -> float: ...


class MotorSettings(Protocol):
    """What the loop needs of a motor's section of the robot file. `rated`: rad/s at full duty."""

    @property
    def rated(self) -> float: ...
    @property
    def loop(self) -> SpeedLoopSettings: ...


def speed_gains(motor: MotorSettings) -> SpeedGains:
    """Gains of one wheel's loop; without `loop.speed` the slope follows from the rated speed."""
    loop = motor.loop
    slope = loop.speed if loop.speed is not None else (1.0 - loop.static) / motor.rated
    return SpeedGains(loop.static, slope, loop.proportional, loop.integral)


class WheelSpeedLoop:
    """One wheel's loop. `duty` is what the motor gets, `direction` the sign of its counts."""

    __slots__ = (
        "_before",
        "_gains",
        "_integral",
        "_last",
        "_moved",
        "_pitch",
        "_slewing",
        "direction",
        "duty",
        "fault",
        "target",
    )

    def __init__(self, gains: SpeedGains, slots: int) -> None:
        self._gains = gains
        self._pitch = 2 * pi / slots
        self.direction = 1
        self.target = self.duty = self._integral = 0.0
        self.fault = self._slewing = False
        self._last: int | None = None
        self._before: int | None = None
        self._moved = 0

    def edge(self, now: int) -> None:
        """An edge that passed the glitch filter."""
        self._before, self._last = self._last, now
        self._moved = now

    def command(self, now: int, target: float) -> None:
        """Take a new target (rad/s); its feed-forward acts at once."""
        before = self.target
        self.target = target
        if target == 0.0 or target * before <= 0.0:
            self._integral = 0.0
            self._last = self._before = None
            self._moved = now
            self._slewing = target * self.duty < 0.0
        if target:
            self.direction = 1 if target > 0.0 else -1
        self._drive(now, 0.0)

    @property
    def resting(self) -> bool:
        """True when `tick` would change nothing: no motion is wanted, none is driven."""
        return self.target == 0.0 and self.duty == 0.0

    def power(self, now: int, duty: float) -> None:
        """Take a raw duty in place of a target; `watch` it each TICK."""
        if abs(self.duty) <= STALL_DUTY:
            self._moved = now
        self.duty = 0.0 if self.fault else duty
        if duty:
            self.direction = 1 if duty > 0.0 else -1

    def watch(self, now: int, duty: float) -> bool:
        """Look for a stall at a raw duty; False when there is nothing to look for."""
        if abs(duty) <= STALL_DUTY:
            self._moved = now
        elif now - self._moved > STALL_TIME:
            self.fault = True
            self.duty = 0.0
        return self.duty != 0.0

    def tick(self, now: int) -> float:
        """Run the loop once, each TICK; returns the duty."""
        if self.target == 0.0 or self.fault:
            self.duty = 0.0
            return 0.0
        if -STALL_DUTY <= self.duty <= STALL_DUTY:
            self._moved = now
        elif now - self._moved > STALL_TIME:
            self.fault = True
            self.duty = 0.0
            return 0.0
        self._drive(now, TICK_SECONDS)
        return self.duty

    def measured(self, now: int) -> float | None:
        """Speed (rad/s) from the last period and the age of the last edge, or None."""
        last, before = self._last, self._before
        if last is None or before is None:
            return None
        age, period = now - last, last - before
        if age > SILENCE:
            return None
        longest = age if age > period else period
        return self.direction * self._pitch / (longest * 1e-9)

    def _drive(self, now: int, step: float) -> None:
        target = self.target
        if target == 0.0 or self.fault:
            self.duty = 0.0
            return
        static, slope, proportional, integral = self._gains
        speed = self.measured(now)
        error = 0.0 if speed is None else target - speed
        ahead = self.direction * static + slope * target
        wanted = ahead + proportional * error + self._integral
        change = integral * error * step
        power = self.direction * wanted
        if 0.0 <= power <= 1.0:
            self._gather(change)
        else:  # out of what the motor can be given: gather only what leads back
            if (power - 1.0) * self.direction * change < 0.0:
                self._gather(change)
            wanted = float(self.direction) if power > 1.0 else 0.0
        self.duty = self._slewed(wanted, step) if self._slewing else wanted

    def _gather(self, change: float) -> None:
        total = self._integral + change
        if -MOST_INTEGRAL <= total <= MOST_INTEGRAL:
            self._integral = total
        else:
            self._integral = MOST_INTEGRAL if total > 0.0 else -MOST_INTEGRAL

    def _slewed(self, wanted: float, step: float) -> float:
        """The next duty on the way to `wanted` through a reversal."""
        limit = SLEW if step else 0.0
        growth = self.direction * (wanted - self.duty)
        self._slewing = growth > limit
        return self.duty + self.direction * limit if self._slewing else wanted
