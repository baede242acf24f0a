"""One wheel of the simulated robot: motor, gear, friction and a slotted disc.

Between two breaks (a change of duty, a step of the ripple's grid, coming to rest) the speed follows
an exponential exactly, so that neither the angle nor the time of an edge depends on how the caller
cuts time into steps. Speeds are rad/s, angles rad, times integer nanoseconds.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from math import copysign, exp, inf, log, pi, sin
from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import EncoderTruth, MotorTruth
from diffbotctl.time import NEVER, SECOND

RIPPLE_STEP = 10_000_000  # ns that the ripple is held: a twentieth of its period at 100 rpm
RIPPLE_CYCLES = 3  # per wheel turn: the last gear but one of a 1:48 box turns about so often
REST_SPEED = 0.1  # rad/s (3 mm/s with a 65 mm wheel); below it friction holds an undriven wheel
BOUNCE_EDGES = 3  # additional edges of a bouncing one
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


class LevelChange(NamedTuple):
    """An encoder's pin goes to `level` (0 or 1) at `time` (ns)."""

    time: int
    level: int


class EncoderDisc(NamedTuple):
    """A slotted disc. `edges`: angles in one turn (rad), rising and falling alternately."""

    edges: tuple[float, ...]
    start: float  # rad; the disc's angle under the light barrier at the start
    jitter: float  # s; standard deviation of an edge's delay
    bounce: float = 0.0  # s; longest time that an edge bounces


def draw_motors(rated: float, truth: MotorTruth, rng: Random) -> tuple[MotorModel, MotorModel]:
    """The left and the right motor, of one make. `rated`: nominal speed at full duty, rad/s."""
    lag = rng.uniform(*truth.lag)
    motors = []
    for _ in range(2):
        start = rng.uniform(*truth.start_duty)
        motors.append(
            MotorModel(
                speed=rated * (1.0 + rng.uniform(-1.0, 1.0) * truth.gain_spread),
                lag=lag * (1.0 + rng.uniform(-1.0, 1.0) * truth.lag_spread),
                start=start,
                keep=start * truth.keep_share,
                ripple=truth.ripple,
                ripple_phase=rng.uniform(0.0, 2 * pi),
                coulomb=truth.coasting == "coulomb",
            )
        )
    return motors[0], motors[1]


def draw_disc(truth: EncoderTruth, slots: int, rng: Random) -> EncoderDisc:
    """Draw a disc with `slots` slots."""
    pitch = 2 * pi / slots
    duty = _within(rng.gauss(0.5, truth.duty_spread), 0.3, 0.7)
    edges = []
    for slot in range(slots):
        # The limits keep the order of slots and bars.
        place = slot + _within(rng.gauss(0.0, truth.slot_spread), -0.12, 0.12)
        end = slot + duty + _within(rng.gauss(0.0, truth.slot_spread), -0.12, 0.12)
        edges += [place * pitch, end * pitch]
    start = rng.uniform(0.0, 2 * pi) if truth.phase == "random" else 0.0
    return EncoderDisc(tuple(edges), start, truth.jitter, truth.bounce)


class WheelModel:
    """A wheel driven by its motor, and its encoder's pin.

    `angle` (rad since the start, forward positive) and `speed` (rad/s) hold at `now`.

    Time is divided into stretches of exact exponential motion: within one the speed tends from
    `_settled_speed` + `_excess_speed` towards `_settled_speed`. Edges are numbered; the pin is at
    level 1 after an odd one. `_previous_edge` and `_next_edge` are the angles between which no edge
    lies.
    """

    __slots__ = (
        "_changes",
        "_counted",
        "_disc",
        "_edge_index",
        "_excess_speed",
        "_hand_motion",
        "_keep",
        "_lag",
        "_next_edge",
        "_pending",
        "_phase",
        "_previous_edge",
        "_ripple",
        "_rng",
        "_scale",
        "_settled_speed",
        "_start_angle",
        "_step_decay",
        "_stops_at_end",
        "_stretch_end",
        "_stretch_start",
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
        self.motor = motor
        self._counted = int(falling)  # parity of the edges that count going forward
        self._disc = disc
        self._rng = rng
        self.now = now
        self.angle = self.speed = self.duty = 0.0
        self._pending: deque[int] = deque()
        self._changes: deque[LevelChange] | None = None
        self._keep, self._lag = motor.keep, motor.lag
        self._ripple, self._phase = motor.ripple, motor.ripple_phase
        self._scale = motor.speed / (1.0 - motor.keep)
        self._step_decay = exp(-RIPPLE_STEP * 1e-9 / motor.lag)
        self._hand_motion = (0, 0.0)  # until when (ns) a hand turns it, and at which rad/s
        self._edge_index = bisect_right(disc.edges, disc.start)
        # The first edge of a disc may lie a little before its zero.
        while self._edge_angle(self._edge_index) <= 0.0:
            self._edge_index += 1
        self._previous_edge = self._edge_angle(self._edge_index - 1)
        self._next_edge = self._edge_angle(self._edge_index)
        self._begin_stretch()

    @property
    def level(self) -> int:
        """Level of the pin: 1 while a slot is open."""
        return self._edge_index % 2

    def watch(self, on: bool) -> None:
        """Start or stop collecting what `changes` returns."""
        self._changes = deque() if on else None

    def changes(self, until: int) -> list[LevelChange]:
        """Changes of the watched pin since the last call, until `until`; after `advance`."""
        changes: list[LevelChange] = []
        while self._changes and self._changes[0].time <= until:
            changes.append(self._changes.popleft())
        return changes

    def turn_by_hand(self, angle: float, speed: float) -> int:
        """From now on a hand turns it by `angle` rad at `speed` rad/s. Returns its end, ns."""
        until = self.now + round(abs(angle) / speed * SECOND)
        self._hand_motion = (until, speed if angle > 0.0 else -speed)
        self._begin_stretch()
        return until

    def advance(self, until: int, duty: float) -> Sequence[int]:
        """Drive with `duty` (-1 to 1) from `now` until `until`.

        Returns the times (ns) of the counted edges until then, in order.
        """
        if duty != self.duty or self.now == self._stretch_end:
            self.duty = duty
            self._begin_stretch()
        while until > self._stretch_end:
            self._follow(self._stretch_end)
            self._begin_stretch()
        if self._stretch_end == NEVER:
            self.now = until
        elif until > self.now:
            self._follow(until)
        return self._take_pending(until) if self._pending else ()

    def _begin_stretch(self) -> None:
        """Start a stretch of exact exponential motion at `now`."""
        now, angle, speed, duty = self.now, self.angle, self.speed, self.duty
        self._stretch_start, self._start_angle = now, angle
        self._stops_at_end = False
        if now < self._hand_motion[0]:
            self._settled_speed, self._excess_speed = self._hand_motion[1], 0.0
            self._stretch_end = min(self._hand_motion[0], (now // RIPPLE_STEP + 1) * RIPPLE_STEP)
            self._stops_at_end = self._stretch_end == self._hand_motion[0]
            return
        start = self.motor.start
        if speed == 0.0 and -start <= duty <= start:
            self._settled_speed = self._excess_speed = 0.0
            self._stretch_end = NEVER
            return
        if self._ripple:
            duty *= 1.0 + self._ripple * sin(RIPPLE_CYCLES * angle + self._phase)
        if duty > self._keep and speed >= 0.0:  # the usual case first
            settled = self._scale * (duty - self._keep)
        else:
            settled = settled_speed(self.motor, duty, speed)
        self._settled_speed, self._excess_speed = settled, speed - settled
        self._stretch_end = (now // RIPPLE_STEP + 1) * RIPPLE_STEP
        # Only a slowing wheel can come to rest within this stretch.
        if speed != 0.0 and ((settled > 0.0) != (speed > 0.0) or settled == 0.0):
            self._end_at_rest(speed, settled)

    def _end_at_rest(self, speed: float, settled: float) -> None:
        """End the stretch where the wheel comes to rest, if that is within it."""
        ratio = abs(speed) / REST_SPEED if settled == 0.0 else (speed - settled) / -settled
        time = self.motor.lag * log(ratio) if ratio > 1.0 else 0.0
        end = self.now + int(time * SECOND) + 1
        if end <= self._stretch_end:
            self._stretch_end, self._stops_at_end = end, True

    def _follow(self, until: int) -> None:
        """Follow the stretch until `until`, which lies within it."""
        settled, excess, lag = self._settled_speed, self._excess_speed, self._lag
        span = until - self._stretch_start
        elapsed = span * 1e-9
        decay = self._step_decay if span == RIPPLE_STEP else exp(-elapsed / lag)
        self.speed = settled + excess * decay
        angle = self._start_angle + settled * elapsed + excess * lag * (1.0 - decay)
        if angle >= self._next_edge or angle < self._previous_edge:
            self._cross_edges(angle, elapsed)
        self.angle = angle
        self.now = until
        if self._stops_at_end and until == self._stretch_end:
            self.speed = 0.0

    def _cross_edges(self, angle: float, elapsed: float) -> None:
        """Pass the edges up to `angle`, which is reached `elapsed` seconds into the stretch.

        Only those that count are timed, unless the pin is watched.
        """
        watched = self._changes is not None
        while angle >= self._next_edge:
            if watched or self._edge_index % 2 == self._counted:
                self._record_edge(self._next_edge, angle, elapsed, 1 - self._edge_index % 2)
            self._edge_index += 1
            self._previous_edge = self._next_edge
            self._next_edge = self._edge_angle(self._edge_index)
        while angle < self._previous_edge:
            self._edge_index -= 1
            if watched or self._edge_index % 2 != self._counted:
                self._record_edge(self._previous_edge, angle, elapsed, self._edge_index % 2)
            self._next_edge = self._previous_edge
            self._previous_edge = self._edge_angle(self._edge_index - 1)

    def _record_edge(self, place: float, angle: float, elapsed: float, level: int) -> None:
        """Record the edge at angle `place`, after which the pin is at `level`."""
        guess = elapsed * (place - self._start_angle) / (angle - self._start_angle)
        time = self._stretch_start + round(self._crossing_time(place, guess, elapsed) * SECOND)
        if self._disc.jitter:
            # A light barrier can only be late. A mean delay is the same for every edge.
            time += int(abs(self._rng.gauss(0.0, self._disc.jitter)) * SECOND)
        times = [time]
        if self._disc.bounce:
            window = self._disc.bounce * SECOND
            times += sorted(time + int(self._rng.random() * window) for _ in range(BOUNCE_EDGES))
        if level != self._counted:
            if self._pending:
                times[0] = max(time, self._pending[-1])
            self._pending.extend(times)
        if self._changes is not None:
            _append_changes(self._changes, times, level)

    def _crossing_time(self, place: float, elapsed: float, high: float) -> float:
        """Seconds from the stretch's start at which the angle is `place` (Newton, bracketed).

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

    def _edge_angle(self, index: int) -> float:
        turn, place = divmod(index, len(self._disc.edges))
        return self._disc.edges[place] + turn * 2 * pi - self._disc.start

    def _take_pending(self, until: int) -> list[int]:
        times = []
        while self._pending and self._pending[0] <= until:
            times.append(self._pending.popleft())
        return times


def _append_changes(changes: deque[LevelChange], times: Sequence[int], level: int) -> None:
    """Append the pin's changes: it goes to `level` at all these times, and back in between."""
    earliest = changes[-1].time if changes else 0
    for before, time in zip([None, *times], times, strict=False):
        if before is not None:
            changes.append(LevelChange(max(earliest, (before + time) // 2), 1 - level))
        changes.append(LevelChange(max(earliest, time), level))


def settled_speed(motor: MotorModel, duty: float, speed: float) -> float:
    """Speed (rad/s) towards which a wheel tends that turns at `speed` and is driven with `duty`."""
    friction = copysign(motor.keep, speed if motor.coulomb and speed else duty)
    if abs(duty) <= motor.keep and not (motor.coulomb and speed):
        return 0.0
    return motor.speed / (1.0 - motor.keep) * (duty - friction)


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)
