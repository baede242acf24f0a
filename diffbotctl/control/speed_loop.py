"""The wheel-speed loop: feed-forward with dead band, and PI control of the speed from the edges.

The only definition in Python; the firmware implements the same specification in C. The simulated
board runs `WheelSpeedLoop`; odometry runs `SpeedLoopMirror` to know the duty that a real board
applies; the block `wheel_speed` and calibration use the feed-forward. Speeds are rad/s, duty is -1
to 1, times are integer nanoseconds.
"""

from __future__ import annotations

from math import copysign, pi
from typing import NamedTuple, Protocol

from diffbotctl.time import MILLISECOND

LOOP_PERIOD = 10 * MILLISECOND
LOOP_PERIOD_S = 0.010
EDGE_TIMEOUT = 300 * MILLISECOND  # without an edge, after which the speed is unknown
INTEGRAL_MAX = 0.25  # duty; covers the spread of cold motors
SLEW_MAX = 0.05  # duty per period during a reversal, to protect the gears
STALL_DUTY_MIN = 0.3  # above it a turning wheel gives edges
STALL_TIMEOUT = 500 * MILLISECOND


class SpeedGains(NamedTuple):
    """Gains of one loop: feed-forward `static` (duty) and `slope` (duty per rad/s), PI gains."""

    static: float
    slope: float
    proportional: float  # duty per rad/s
    integral: float  # duty per rad

    def duty(self, target: float, error: float = 0.0, integral: float = 0.0) -> float:
        """Duty, not limited, for `target` (rad/s, not 0), `error` (rad/s) and `integral` (duty)."""
        feed_forward = copysign(self.static, target) + self.slope * target
        return feed_forward + self.proportional * error + integral


class SpeedLoopSettings(Protocol):
    """`loop` of a motor in the robot file. `speed`: duty per rad/s; None: from the rated speed."""

    @property
    def static(self) -> float: ...
    @property
    def speed(self) -> float | None: ...
    @property
    def proportional(self) -> float: ...
    @property
    def integral(self) -> float: ...


class MotorSettings(Protocol):
    """The motor section of a side in the robot file. `rated`: rad/s at full duty."""

    @property
    def rated(self) -> float: ...
    @property
    def loop(self) -> SpeedLoopSettings: ...


def speed_gains(motor: MotorSettings) -> SpeedGains:
    """Gains of one wheel's loop; without `loop.speed` the slope follows from the rated speed."""
    loop = motor.loop
    slope = loop.speed if loop.speed is not None else (1.0 - loop.static) / motor.rated
    return SpeedGains(loop.static, slope, loop.proportional, loop.integral)


def limit_duty(duty: float, target: float) -> float:
    """`duty` limited to 0 to 1 in the direction of `target`; 0 for target 0."""
    power = duty if target > 0.0 else -duty
    if not (target and power > 0.0):
        return 0.0
    return duty if power <= 1.0 else copysign(1.0, target)


def limit_integral(integral: float, limit: float = INTEGRAL_MAX) -> float:
    """`integral` (duty) limited to +-`limit`."""
    if -limit <= integral <= limit:  # nearly always; comparisons are faster than min and max
        return integral
    return copysign(limit, integral)


class SpeedLoop:
    """Target, measured speed and integral of one wheel: what board and mirror have in common."""

    __slots__ = ("gains", "integral", "last_edge", "pitch", "previous_edge", "target")

    def __init__(self, gains: SpeedGains, slots: int) -> None:
        self.gains = gains
        self.pitch = 2 * pi / slots
        self.target = self.integral = 0.0
        self.last_edge: int | None = None  # since the target changed its sign
        self.previous_edge: int | None = None

    def set_target(self, target: float) -> bool:
        """Set a new target (rad/s); True if it resets the loop: a stop or a change of direction."""
        begins = target == 0.0 or target * self.target <= 0.0
        if begins:
            self.integral = 0.0
            self.last_edge = self.previous_edge = None
        self.target = target
        return begins

    def measured(self, now: int) -> float | None:
        """Speed (rad/s) from the last period and the age of the last edge; None if unknown."""
        last, previous = self.last_edge, self.previous_edge
        if last is None or previous is None:
            return None
        age, period = now - last, last - previous
        if age > EDGE_TIMEOUT:
            return None
        longest = age if age > period else period
        return copysign(self.pitch / (longest * 1e-9), self.target)


class WheelSpeedLoop(SpeedLoop):
    """The loop of a board. `duty` goes to the motor; `direction` is the sign of the counts."""

    __slots__ = ("_moved", "_slewing", "direction", "duty", "fault")

    def __init__(self, gains: SpeedGains, slots: int) -> None:
        super().__init__(gains, slots)
        self.direction = 1
        self.duty = 0.0
        self.fault = self._slewing = False
        self._moved = 0

    def edge(self, now: int) -> None:
        """Record an edge that passed the glitch filter."""
        self.previous_edge, self.last_edge = self.last_edge, now
        self._moved = now

    def command(self, now: int, target: float) -> None:
        """Set a new target (rad/s); its feed-forward is applied immediately."""
        if self.set_target(target):
            self._moved = now
            self._slewing = target * self.duty < 0.0
        if target:
            self.direction = 1 if target > 0.0 else -1
        self._drive(now, 0.0)

    @property
    def is_at_rest(self) -> bool:
        """True when `tick` would change nothing."""
        return self.target == 0.0 and self.duty == 0.0

    def set_duty(self, now: int, duty: float) -> None:
        """Apply a duty instead of a target; call `check_stall` each LOOP_PERIOD."""
        if abs(self.duty) <= STALL_DUTY_MIN:
            self._moved = now
        self.duty = 0.0 if self.fault else duty
        if duty:
            self.direction = 1 if duty > 0.0 else -1

    def check_stall(self, now: int, duty: float) -> bool:
        """Detect a stall at `duty` and switch the motor off; False when it is off."""
        if -STALL_DUTY_MIN <= duty <= STALL_DUTY_MIN:
            self._moved = now
        elif now - self._moved > STALL_TIMEOUT:
            self.fault = True
            self.duty = 0.0
        return self.duty != 0.0

    def tick(self, now: int) -> float:
        """Run the loop once; call it each LOOP_PERIOD. Returns the duty."""
        if self.target != 0.0 and not self.fault:
            self.check_stall(now, self.duty)
        self._drive(now, LOOP_PERIOD_S)
        return self.duty

    def _drive(self, now: int, step: float) -> None:
        target = self.target
        if target == 0.0 or self.fault:
            self.duty = 0.0
            return
        speed = self.measured(now)
        error = 0.0 if speed is None else target - speed
        duty = self.gains.duty(target, error, self.integral)
        limited = limit_duty(duty, target)
        change = self.gains.integral * error * step
        # anti-windup: while the duty is limited, integrate only towards the limits
        if duty == limited or (duty - limited) * change < 0.0:
            self.integral = limit_integral(self.integral + change)
        self.duty = self._slewed(limited, step) if self._slewing else limited

    def _slewed(self, duty: float, step: float) -> float:
        """The next duty of a reversal that ends at `duty`."""
        limit = SLEW_MAX if step else 0.0
        growth = self.direction * (duty - self.duty)
        self._slewing = growth > limit
        return self.duty + self.direction * limit if self._slewing else duty


class SpeedLoopMirror(SpeedLoop):
    """Reconstruction on the host of the duty that a board's loop applies.

    The host knows every target and the time of nearly every edge, measured or estimated from the
    counts, but no frame carries the duty. Without it the wheel filter would attribute the action of
    the loop to friction. Slewing and stalls are not modelled.
    """

    __slots__ = ("time",)

    def __init__(self, gains: SpeedGains, slots: int, time: int) -> None:
        super().__init__(gains, slots)
        self.time = time

    def update(self, time: int, steps: int, edge: int, target: float, since: int) -> float:
        """Apply one frame and return the duty.

        `steps`: counts since the previous frame, the last of them at time `edge`; `target` (rad/s)
        is in effect since time `since`.
        """
        if target != self.target and since <= edge:
            self._run(since)
            self.set_target(target)
        if steps:
            if abs(steps) > 1 and self.last_edge is not None:  # assume evenly spaced edges
                self.last_edge = edge - (edge - self.last_edge) // abs(steps)
            self._run(edge)
            self.previous_edge, self.last_edge = self.last_edge, edge
        if target != self.target:
            self._run(since)
            self.set_target(target)
        self._run(time)
        if target == 0.0:
            return 0.0
        speed = self.measured(time) if self.gains.proportional else None
        error = 0.0 if speed is None else target - speed
        return limit_duty(self.gains.duty(target, error, self.integral), target)

    def _run(self, until: int) -> None:
        """Integrate each LOOP_PERIOD until then. The phase of the board's timer is unknown, but one
        period changes the integral by too little to matter."""
        if not self.target or self.previous_edge is None:
            self.time = max(until, self.time)
            return
        while self.time + LOOP_PERIOD <= until:
            self.time += LOOP_PERIOD
            speed = self.measured(self.time)
            if speed is not None:
                angle = (self.target - speed) * LOOP_PERIOD_S
                self.integral = limit_integral(self.integral + self.gains.integral * angle)
