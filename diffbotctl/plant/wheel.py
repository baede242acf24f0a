"""One wheel of the simulated robot: motor, gear, friction and a slotted disc.

Between two breaks (a change of duty, a step of the ripple's grid, coming to rest) the speed follows
an exponential exactly, so that neither the angle nor the time of an edge depends on how the caller
cuts time into steps. Speeds are rad/s, angles rad, times integer nanoseconds.
"""

from collections.abc import Sequence
from math import copysign, exp, inf, log, pi, sin
from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import MotorTruth
from diffbotctl.plant.encoder_disc import EncoderDisc
from diffbotctl.plant.encoder_wheel import EncoderWheel
from diffbotctl.time import NEVER, SECOND

RIPPLE_STEP = 10_000_000  # ns that the ripple is held: a twentieth of its period at 100 rpm
RIPPLE_CYCLES = 3  # per wheel turn: the last gear but one of a 1:48 box turns about so often
REST_SPEED = 0.1  # rad/s (3 mm/s with a 65 mm wheel); below it friction holds an undriven wheel
CROSSING_TOLERANCE_S = 1e-10  # a tenth of the clock's nanosecond


class MotorModel(NamedTuple):
    """The true parameters of one motor with its gear.

    At duty u a turning wheel settles at `speed` * (u - keep) / (1 - keep), with the time constant
    `lag`; a resting one breaks loose above `start`. `coulomb`: friction also brakes an undriven
    wheel, otherwise its speed decays exponentially.
    """

    speed: float  # rad/s at full duty
    lag: float  # s
    start: float  # duty
    keep: float  # duty
    ripple: float = 0.0
    ripple_phase: float = 0.0  # rad
    coulomb: bool = False

    @property
    def no_load_speed(self) -> float:
        """Speed (rad/s) at full duty without friction."""
        return self.speed / (1.0 - self.keep)


def draw_motors(
    rated: tuple[float, float], truth: MotorTruth, rng: Random
) -> tuple[MotorModel, MotorModel]:
    """The left and the right motor. `rated`: their nominal speeds at full duty, rad/s."""
    lag = rng.uniform(*truth.lag)
    motors = []
    for nominal in rated:
        start = rng.uniform(*truth.start_duty)
        motors.append(
            MotorModel(
                speed=nominal * (1.0 + rng.uniform(-1.0, 1.0) * truth.gain_spread),
                lag=lag * (1.0 + rng.uniform(-1.0, 1.0) * truth.lag_spread),
                start=start,
                keep=start * truth.keep_share,
                ripple=truth.ripple,
                ripple_phase=rng.uniform(0.0, 2 * pi),
                coulomb=truth.coasting == "coulomb",
            )
        )
    return motors[0], motors[1]


class WheelModel(EncoderWheel):
    """A wheel driven by its motor.

    `angle` (rad since the start, forward positive) and `speed` (rad/s) hold at `now`.

    Time is divided into segments of exact exponential motion: within one the speed tends from
    `_settled_speed` + `_excess_speed` towards `_settled_speed`.
    """

    __slots__ = (
        "_drag",
        "_excess_speed",
        "_hand_speed",
        "_hand_until",
        "_keep",
        "_lag",
        "_phase",
        "_ripple",
        "_scale",
        "_segment_end",
        "_segment_start",
        "_settled_speed",
        "_start_angle",
        "_step_decay",
        "_stops_at_end",
        "angle",
        "duty",
        "motor",
        "now",
        "speed",
    )

    def __init__(
        self,
        motor: MotorModel,
        disc: EncoderDisc,
        rng: Random,
        now: int = 0,
        falling: bool = False,
    ) -> None:
        """`falling`: the board counts falling edges of the pin instead of rising ones."""
        super().__init__(disc, rng, falling)
        self.motor = motor
        self.now = now
        self.angle = self.speed = self.duty = 0.0
        self._keep, self._lag, self._drag = motor.keep, motor.lag, 0.0
        self._ripple, self._phase = motor.ripple, motor.ripple_phase
        self._scale = motor.speed / (1.0 - motor.keep)
        self._step_decay = exp(-RIPPLE_STEP * 1e-9 / motor.lag)
        self._hand_until, self._hand_speed = 0, 0.0  # a hand turns it until then (ns), rad/s
        self._begin_segment()

    def turn_by_hand(self, angle: float, speed: float) -> int:
        """From now on a hand turns it by `angle` rad at `speed` rad/s. Returns its end, ns."""
        until = self.now + round(abs(angle) / speed * SECOND)
        self._hand_until, self._hand_speed = until, speed if angle > 0.0 else -speed
        self._begin_segment()
        return until

    def set_drag(self, drag: float) -> None:
        """From now on a friction brakes it that it takes `drag` (duty) to overcome."""
        self._drag, self._keep = drag, self.motor.keep + drag
        self._begin_segment()

    def advance(self, until: int, duty: float) -> Sequence[int]:
        """Drive with `duty` (-1 to 1) from `now` until `until`.

        Returns the times (ns) of the counted edges until then, in order.
        """
        if duty != self.duty or self.now == self._segment_end:
            self.duty = duty
            self._begin_segment()
        while until > self._segment_end:
            self._follow(self._segment_end)
            self._begin_segment()
        if self._segment_end == NEVER:
            self.now = until
        elif until > self.now:
            self._follow(until)
        return self._pins.take(until)

    def _begin_segment(self) -> None:
        """Start a segment of exact exponential motion at `now`."""
        now, angle, speed, duty = self.now, self.angle, self.speed, self.duty
        self._segment_start, self._start_angle = now, angle
        self._stops_at_end = False
        if now < self._hand_until:
            self._settled_speed, self._excess_speed = self._hand_speed, 0.0
            self._segment_end = min(self._hand_until, (now // RIPPLE_STEP + 1) * RIPPLE_STEP)
            self._stops_at_end = self._segment_end == self._hand_until
            return
        if speed == 0.0 and abs(duty) <= self.motor.start + self._drag:
            self._settled_speed = self._excess_speed = 0.0
            self._segment_end = NEVER
            return
        if self._ripple:
            duty *= 1.0 + self._ripple * sin(RIPPLE_CYCLES * angle + self._phase)
        if duty > self._keep and speed >= 0.0:  # the usual case first
            settled = self._scale * (duty - self._keep)
        else:
            settled = settled_speed(self.motor, duty, speed, self._drag)
        self._settled_speed, self._excess_speed = settled, speed - settled
        self._segment_end = (now // RIPPLE_STEP + 1) * RIPPLE_STEP
        # Only a slowing wheel can come to rest within this segment.
        if speed * settled <= 0.0 and speed != 0.0:
            self._end_at_rest(speed, settled)

    def _end_at_rest(self, speed: float, settled: float) -> None:
        """End the segment where the wheel comes to rest, if that is within it."""
        ratio = abs(speed) / REST_SPEED if settled == 0.0 else (speed - settled) / -settled
        time = self.motor.lag * log(ratio) if ratio > 1.0 else 0.0
        end = self.now + int(time * SECOND) + 1
        if end <= self._segment_end:
            self._segment_end, self._stops_at_end = end, True

    def _follow(self, until: int) -> None:
        """Follow the segment until `until`, which lies within it."""
        settled, excess, lag = self._settled_speed, self._excess_speed, self._lag
        span = until - self._segment_start
        elapsed = span * 1e-9
        decay = self._step_decay if span == RIPPLE_STEP else exp(-elapsed / lag)
        self.speed = settled + excess * decay
        angle = self._start_angle + settled * elapsed + excess * lag * (1.0 - decay)
        if not self._previous_edge <= angle < self._next_edge:
            self._cross_edges(angle, lambda place: self._time_at(place, angle, elapsed))
        self.angle = angle
        self.now = until
        if self._stops_at_end and until == self._segment_end:
            self.speed = 0.0

    def _time_at(self, place: float, angle: float, elapsed: float) -> int:
        """When (ns) the angle was `place`; it is `angle` at `elapsed` seconds of the segment."""
        guess = elapsed * (place - self._start_angle) / (angle - self._start_angle)
        return self._segment_start + round(self._crossing_time(place, guess, elapsed) * SECOND)

    def _crossing_time(self, place: float, elapsed: float, high: float) -> float:
        """Seconds from the segment's start at which the angle is `place` (Newton, bracketed).

        `elapsed` is a guess; at `high` seconds the place has been passed.
        """
        lag, settled, excess = self._lag, self._settled_speed, self._excess_speed
        start, low = self._start_angle, 0.0
        forward = place >= start
        for _ in range(60):  # bisection alone would need 30
            decay = exp(-elapsed / lag)
            error = start + settled * elapsed + excess * lag * (1.0 - decay) - place
            if (error > 0.0) == forward:
                high = elapsed
            else:
                low = elapsed
            speed = settled + excess * decay
            following = elapsed - (error / speed if speed else inf)
            if not low <= following <= high:
                following = 0.5 * (low + high)
            if abs(following - elapsed) < CROSSING_TOLERANCE_S:
                return following
            elapsed = following
        return elapsed


def settled_speed(motor: MotorModel, duty: float, speed: float, drag: float = 0.0) -> float:
    """Speed (rad/s) towards which a wheel tends that turns at `speed` and is driven with `duty`.

    `drag`: further friction, in duty, that brakes it also without drive.
    """
    scale = motor.speed / (1.0 - motor.keep)
    friction = copysign(motor.keep, speed if motor.coulomb and speed else duty)
    if drag:
        friction += copysign(drag, speed or duty)
    if abs(duty) <= motor.keep and not (motor.coulomb and speed):
        return -copysign(drag, speed) * scale if drag and speed else 0.0
    return scale * (duty - friction)
