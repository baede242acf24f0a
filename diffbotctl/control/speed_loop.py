"""The wheel-speed loop: feed-forward with dead band, and PI control of the speed from the edges.

The only definition in Python; the firmware implements the same specification in C. The simulated
board runs `WheelSpeedLoop`; odometry, the block `wheel_speed` and calibration use the feed-forward.
Speeds are rad/s, duty is -1 to 1, times are integer nanoseconds.

The error of the speed compares two angles since the last edge: that of a reference model, which
follows the target with the lag of a usual motor, and the pitches that the wheel has turned. A wheel
between the reference model and the target has no error: its motor is quicker than the model.
Without an edge the wheel has turned less than one pitch; that also is a measurement, of a wheel
that is too slow or does not turn at all. The duty of a wheel that does not turn rises to full duty
before the stall is reported, so that stiff gears and weak batteries are no stall.
"""

from math import copysign, pi
from typing import NamedTuple, Protocol

from diffbotctl.time import MILLISECOND

LOOP_PERIOD = 10 * MILLISECOND
LOOP_PERIOD_S = 0.010
REFERENCE_GAIN = 1.0 / 11.0  # per period: the reference model has a lag of 0.1 s
SPAN_MIN = 5 * MILLISECOND  # of the edges that give one measurement: many of a fine encoder
# One measurement is integrated for this many periods. The wheel speed follows after the next edge
# only, and a motor at a low duty is up to five times as sensitive as the feed-forward states, so
# longer intervals count less.
HOLD_PERIODS = 4
FULL_WEIGHT_INTERVAL_S = 0.040  # between two edges
FULL_WEIGHT_PERIODS = 4.0
# An edge is overdue when the reference model has turned by more than a pitch since the last one.
KICK_DELAY_PERIODS = 3.0  # of an overdue edge, before the duty rises
KICK_RATE = 1.8e-3  # duty per period, and per period since: a duty of 1 after 0.33 s
RETURN_FACTOR = 3.0  # of that rate while the duty is below the feed-forward
KICK_SHARE = 0.5  # of the integral that is kept at the first edge after it
# With more than one edge a period, a wheel that is slower by more than this share of its target has
# not overcome static friction: an edge of a fine encoder does not show that it turns.
STUCK_RATIO = 0.5
WEIGHT_MIN = 0.125  # of a measurement, which is halved when a turning wheel has to be kicked
SLEW_MAX = 0.05  # duty per period during a reversal, to protect the gears
# A stall: no edge for 0.95 s, or 0.6 s and the motor's lag of a wheel that should have turned by
# ten pitches, 0.2 s less of one that was turning; and 0.25 s and the lag more than the time for 2.2
# pitches at the target. The largest distance from rest to the first edge is one pitch. A wheel that
# was turning has no start before it; its kick reaches full duty 0.4 s after the edge was due, and
# that of a fine encoder 0.4 s after the start: the lag is left to turn. An unknown lag is 0.3 s in
# the first time, which ends within 1 s for every lag, and 0 in the second, which must end within
# the lag.
STALL_PERIODS, STALL_PERIODS_CLEAR = 95, 60
STALL_PITCHES, STALL_PITCHES_CLEAR = 2.2, 10.0
STALL_EXCESS_PERIODS = 25
STALL_LAG_PERIODS_MAX, STALL_LAG_TURNING_PERIODS = 30, 20
STALL_DUTY_MIN = 0.3  # of raw duty; above it a turning wheel gives edges
PROPORTIONAL_SHARE = 1.0  # default of the proportional gain, of the slope of the feed-forward
INTEGRAL_TIME_S = 0.1  # default of the integral gain: the slope of the feed-forward over this time
GAIN_MAX = 0.75  # duty per rad/s, of the proportional gain
INTEGRAL_GAIN_MAX = 4.5  # duty per rad


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
    """`loop` of a motor in the robot file; None: from the rated speed.

    `speed`: duty per rad/s.
    """

    @property
    def static(self) -> float: ...
    @property
    def speed(self) -> float | None: ...
    @property
    def proportional(self) -> float | None: ...
    @property
    def integral(self) -> float | None: ...


class MotorSettings(Protocol):
    """The motor section of a side in the robot file. `rated`: rad/s at full duty."""

    @property
    def rated(self) -> float: ...
    @property
    def loop(self) -> SpeedLoopSettings: ...


def speed_gains(motor: MotorSettings) -> SpeedGains:
    """Gains of one wheel's loop; what `loop` leaves open follows from the rated speed."""
    loop = motor.loop
    slope = loop.speed if loop.speed is not None else (1.0 - loop.static) / motor.rated
    proportional, integral = default_gains(slope)
    if loop.proportional is not None:
        proportional = loop.proportional
    if loop.integral is not None:
        integral = loop.integral
    return SpeedGains(loop.static, slope, proportional, integral)


def default_gains(slope: float) -> tuple[float, float]:
    """Proportional (duty per rad/s) and integral gain (duty per rad) for a feed-forward slope."""
    return min(PROPORTIONAL_SHARE * slope, GAIN_MAX), min(
        slope / INTEGRAL_TIME_S, INTEGRAL_GAIN_MAX
    )


def limit_duty(duty: float, target: float) -> float:
    """`duty` limited to 0 to 1 in the direction of `target`; 0 for target 0."""
    power = duty if target > 0.0 else -duty
    if not (target and power > 0.0):
        return 0.0
    return duty if power <= 1.0 else copysign(1.0, target)


def limit_integral(integral: float, limit: float) -> float:
    """`integral` (duty) limited to +-`limit`."""
    if -limit <= integral <= limit:  # nearly always; comparisons are faster than min and max
        return integral
    return copysign(limit, integral)


class WheelSpeedLoop:
    """The loop of one wheel on a board. `duty` goes to the motor; `direction` is the sign of the
    counts.

    `error` (rad/s) and `integral` (duty) are in the direction of the target. `SpeedGains.duty` is
    written out where it is computed in each period, without calls.
    """

    __slots__ = (
        "_edges",
        "_hold",
        "_is_kicked",
        "_is_slewing",
        "_last_edge",
        "_measured_edges",
        "_origin",
        "_origin_periods",
        "_overdue",
        "_reference",
        "_reference_angle",
        "_stall_angle",
        "_stall_excess",
        "_stall_excess_most",
        "_stall_lead",
        "_stall_periods",
        "_stall_periods_clear",
        "_target_angle",
        "_weight",
        "direction",
        "duty",
        "error",
        "fault",
        "gains",
        "integral",
        "pitch",
        "target",
    )

    def __init__(self, gains: SpeedGains, slots: int, lag: float | None = None) -> None:
        """`lag` (s) of the motor, for which a wheel that starts has more time to turn; None:
        unknown."""
        self.gains = gains
        self.pitch = 2 * pi / slots
        self.target = 0.0
        self._begin(0)
        periods = min(round((lag or 0.0) / LOOP_PERIOD_S), STALL_LAG_PERIODS_MAX)
        self._stall_excess_most = STALL_EXCESS_PERIODS + periods
        self._stall_periods_clear = STALL_PERIODS_CLEAR + (periods or STALL_LAG_PERIODS_MAX)
        self._stall_lead = min(periods, STALL_LAG_TURNING_PERIODS)  # of a wheel that was turning
        self.direction = 1
        self.duty = 0.0
        self.fault = self._is_slewing = False
        self._reset_stall()

    def _begin(self, now: int) -> None:
        """Start from rest at `now`."""
        self.error = self.integral = 0.0
        self._reference = self._reference_angle = 0.0  # rad/s; rad since `_origin`
        self._target_angle = 0.0  # rad since `_origin` at the target
        self._origin = self._last_edge = now  # from here the next measurement begins
        self._origin_periods = 0  # loop periods since `_origin`
        self._edges = 0  # since `_origin`
        self._measured_edges = 0  # 0: none yet; 1: `_origin` is an edge; 2: the error is measured
        self._hold = 0  # periods for which the error is still integrated
        self._overdue = 0  # periods since an edge was overdue
        self._is_kicked = False
        self._weight = 1.0  # of a measurement

    def edge(self, now: int) -> None:
        """Record an edge that passed the glitch filter."""
        self._edges += 1
        self._last_edge = now
        self._reset_stall()

    def command(self, now: int, target: float) -> None:
        """Set a new target (rad/s); its feed-forward is applied immediately.

        A target that starts, stops or reverses the wheel resets the loop.
        """
        if target == 0.0 or target * self.target <= 0.0:
            self._begin(now)
            self._reset_stall()
            self._is_slewing = target * self.duty < 0.0
        self.target = target
        if target:
            self.direction = 1 if target > 0.0 else -1
        self._apply(0.0)

    @property
    def is_at_rest(self) -> bool:
        """True when `tick` and `tick_duty` would change nothing."""
        return self.target == 0.0 and self.duty == 0.0

    def set_duty(self, duty: float) -> None:
        """Apply a raw duty instead of a target."""
        self.duty = 0.0 if self.fault else duty
        if duty:
            self.direction = 1 if duty > 0.0 else -1

    def tick(self, now: int) -> float:
        """Run the loop once; call it each LOOP_PERIOD. Returns the duty."""
        if self.target != 0.0 and not self.fault:
            self._run_period(now)
            self._add_to_stall(abs(self.target))
            if self._stall_excess >= self._stall_excess_most:
                has_turned = self._measured_edges == 2
                is_clear = has_turned or self._stall_angle >= STALL_PITCHES_CLEAR * self.pitch
                periods = self._stall_periods_clear - (self._stall_lead if has_turned else 0)
                self._check_stall(periods if is_clear else STALL_PERIODS)
        self._apply(SLEW_MAX)
        return self.duty

    def tick_duty(self) -> float:
        """As `tick`, with a raw duty instead of a target."""
        duty = abs(self.duty)
        if duty <= STALL_DUTY_MIN:
            self._reset_stall()
        else:
            speed = (duty - self.gains.static) / max(self.gains.slope, 1e-6)
            self._add_to_stall(speed)
            self._check_stall(STALL_PERIODS)
        if self.fault:
            self.duty = 0.0
        return self.duty

    def clear_fault(self) -> None:
        """End a fault; the wheel stands until the next command."""
        self.fault = False
        self.target = 0.0  # the next target resets the loop
        self._reset_stall()

    def _apply(self, growth: float) -> None:
        """Set the duty; in a reversal it grows by at most `growth`."""
        if self.target == 0.0 or self.fault:
            self.duty = 0.0
            return
        duty = self._limited_duty()
        if self._is_slewing:
            difference = self.direction * (duty - self.duty)
            self._is_slewing = difference > growth
            if self._is_slewing:
                duty = self.duty + self.direction * growth
        self.duty = duty

    def _limited_duty(self) -> float:
        """The duty for the target, limited to 1 in its direction; 0 for target 0."""
        target, gains = self.target, self.gains
        size = target if target >= 0.0 else -target
        power = gains.static + gains.slope * size + gains.proportional * self.error + self.integral
        if not (target and power > 0.0):
            return 0.0
        if power > 1.0:
            power = 1.0
        return power if target > 0.0 else -power

    def _run_period(self, now: int) -> None:
        """Update error and integral at the end of a LOOP_PERIOD; the target is not 0."""
        target, reference = self.target, self._reference
        if target < 0.0:
            target = -target
        self._reference = reference = reference + (target - reference) * REFERENCE_GAIN
        self._reference_angle += reference * LOOP_PERIOD_S
        self._target_angle += target * LOOP_PERIOD_S
        self._origin_periods += 1
        edges = self._edges
        if edges and (not self._measured_edges or self._last_edge - self._origin >= SPAN_MIN):
            self._measure(target, now)
            edges = 0
        angle, target_angle = self._reference_angle, self._target_angle
        lag = (angle if angle <= target_angle else target_angle) - (edges + 1) * self.pitch
        if lag > 0.0:
            self._integrate(target, self._overdue_change(target, lag))
        elif self._hold:
            self._hold -= 1
            if self.error:
                self._integrate(target, self.gains.integral * self.error * LOOP_PERIOD_S)

    def _measure(self, target: float, now: int) -> None:
        """Take the edges since `_origin` as a measurement of the speed."""
        seconds = (now - self._last_edge) * 1e-9
        angle_after, target_after = self._reference * seconds, target * seconds
        is_stuck = False
        if self._measured_edges:
            span = (self._last_edge - self._origin) * 1e-9
            turned = self._edges * self.pitch
            error = self._reference_angle - angle_after - turned
            target_error = self._target_angle - target_after - turned
            if error * target_error <= 0.0:
                error = 0.0
            elif abs(target_error) < abs(error):
                error = target_error
            error /= span
            is_stuck = error > STUCK_RATIO * target and self.pitch < target * LOOP_PERIOD_S
            interval = span / self._edges
            if interval > FULL_WEIGHT_INTERVAL_S:
                error *= FULL_WEIGHT_INTERVAL_S / interval
            # It hunts if it turned, and stopped.
            if self._is_kicked and self._measured_edges == 2 and not is_stuck:
                self._weight = max(0.5 * self._weight, WEIGHT_MIN)
            self.error = error * self._weight
            self._hold, self._measured_edges = HOLD_PERIODS, 2
        else:
            self.error, self._measured_edges = 0.0, 1
        if self._is_kicked:
            self._is_kicked = False
            if not is_stuck:
                self.integral *= KICK_SHARE
        self._overdue = self._edges = 0
        self._origin, self._origin_periods = self._last_edge, 1
        self._reference_angle, self._target_angle = angle_after, target_after

    def _overdue_change(self, target: float, lag: float) -> float:
        """Change of the integral while an edge is overdue by the angle `lag` (rad)."""
        interval = self.pitch / (target * LOOP_PERIOD_S)  # periods from edge to edge
        error = lag / (self._origin_periods * LOOP_PERIOD_S)
        if interval > FULL_WEIGHT_PERIODS:
            error *= FULL_WEIGHT_PERIODS / interval
        if error > self.error:
            self.error = error
        change = self.gains.integral * self.error * LOOP_PERIOD_S
        self._overdue += 1
        periods = self._overdue - KICK_DELAY_PERIODS
        if self._measured_edges == 2:  # it was turning: perhaps only slower than its target
            periods -= 0.25 * interval
        if periods > 0.0:
            self._is_kicked = True
            rate = KICK_RATE if self.integral >= 0.0 else RETURN_FACTOR * KICK_RATE
            change = max(change, rate * periods)
        return change

    def _integrate(self, target: float, change: float) -> None:
        """Add `change` (duty) to the integral, unless the duty is limited on that side."""
        gains, integral = self.gains, self.integral
        power = gains.static + gains.slope * target + gains.proportional * self.error + integral
        if (power > 1.0 and change > 0.0) or (power < 0.0 and change < 0.0):
            return
        integral += change
        self.integral = integral if -1.0 <= integral <= 1.0 else copysign(1.0, integral)

    def _reset_stall(self) -> None:
        self._stall_periods = 0  # with drive and without an edge
        self._stall_angle = 0.0  # rad that the wheel should have turned meanwhile
        self._stall_excess = 0  # periods since that was STALL_PITCHES

    def _add_to_stall(self, speed: float) -> None:
        """Count a period of a wheel that should turn at `speed` (rad/s) and gives no edge."""
        self._stall_periods += 1
        if self._stall_angle < STALL_PITCHES_CLEAR * self.pitch:
            self._stall_angle += speed * LOOP_PERIOD_S
        if self._stall_angle >= STALL_PITCHES * self.pitch:
            self._stall_excess += 1

    def _check_stall(self, periods: int) -> None:
        """A stall that has lasted for `periods` is a fault."""
        if self._stall_periods >= periods and self._stall_excess >= self._stall_excess_most:
            self.fault = True
