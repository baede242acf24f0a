"""One wheel of the simulated robot: motor, gear, friction and a slotted disc.

Between two breaks (a change of duty, a step of the ripple's grid, coming to rest) the speed follows
an exponential exactly, so that neither the angle nor the time of an edge depends on how the caller
cuts time into steps. Speeds are rad/s, angles rad, times integer nanoseconds.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from math import exp, inf, log, pi, sin
from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import EncoderTruth, MotorTruth
from diffbotctl.time import NEVER, SECOND

GRID = 10_000_000  # ns; the ripple stays constant this long: a twentieth of its period at 100 rpm
RIPPLE_CYCLES = 3  # per wheel turn: the last gear but one of a 1:48 box turns about so often
REST = 0.1  # rad/s (3 mm/s with a 65 mm wheel); undriven and slower than this, friction holds it
CHATTER = 3  # more edges that a bouncing one brings with it
CLOSE = 1e-10  # s; an edge's time is found to this, a tenth of the clock's nanosecond


class MotorModel(NamedTuple):
    """The truth about one motor with its gear.

    At duty u a turning wheel settles at `speed` * (u - keep) / (1 - keep), with the time constant
    `lag`; a resting one breaks loose above `start`. `coulomb`: friction goes on braking when the
    drive is gone, otherwise the speed then dies exponentially.
    """

    speed: float  # rad/s at full duty
    lag: float  # s
    start: float  # duty
    keep: float  # duty
    ripple: float = 0.0
    ripple_phase: float = 0.0  # rad
    coulomb: bool = False


class LevelChange(NamedTuple):
    """What an encoder's pin does at `time` (ns): it goes to `level`, 0 or 1."""

    time: int
    level: int


class EncoderDisc(NamedTuple):
    """A slotted disc: where its flanks lie in one turn, rising and falling in turn, in rad."""

    flanks: tuple[float, ...]
    start: float  # rad; the disc's angle under the light barrier at the start
    jitter: float  # s; standard deviation of an edge's delay
    bounce: float = 0.0  # s; how long an edge chatters at most


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


def draw_disc(truth: EncoderTruth, slots: int, chance: Random) -> EncoderDisc:
    """Draw a disc with `slots` slots."""
    pitch = 2 * pi / slots
    duty = _within(chance.gauss(0.5, truth.duty_spread), 0.3, 0.7)
    flanks = []
    for slot in range(slots):
        # A slot and a bar never swap places: a quarter of the pitch is left on either side.
        place = slot + _within(chance.gauss(0.0, truth.slot_spread), -0.12, 0.12)
        end = slot + duty + _within(chance.gauss(0.0, truth.slot_spread), -0.12, 0.12)
        flanks += [place * pitch, end * pitch]
    start = chance.uniform(0.0, 2 * pi) if truth.phase == "random" else 0.0
    return EncoderDisc(tuple(flanks), start, truth.jitter, truth.bounce)


class WheelModel:
    """A wheel that turns as its motor is driven, and its encoder's pin.

    `angle` (rad since the start, forward positive) and `speed` (rad/s) hold at `now`.
    """

    __slots__ = (
        "_ahead",
        "_angle",
        "_begun",
        "_behind",
        "_chance",
        "_changes",
        "_counted",
        "_disc",
        "_end",
        "_fade",
        "_flank",
        "_halts",
        "_hand",
        "_keep",
        "_lag",
        "_over",
        "_pending",
        "_phase",
        "_ripple",
        "_scale",
        "_settled",
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
        chance: Random,
        now: int = 0,
        falling: bool = False,
    ) -> None:
        """`falling`: the board listens to falling edges of the pin instead of rising ones."""
        self.motor = motor
        self._counted = int(falling)  # parity of the flanks that count going forward
        self._disc = disc
        self._chance = chance
        self.now = now
        self.angle = self.speed = self.duty = 0.0
        self._pending: deque[int] = deque()
        self._changes: deque[LevelChange] | None = None
        self._keep, self._lag = motor.keep, motor.lag
        self._ripple, self._phase = motor.ripple, motor.ripple_phase
        self._scale = motor.speed / (1.0 - motor.keep)
        self._fade = exp(-GRID * 1e-9 / motor.lag)
        self._flank = bisect_right(disc.flanks, disc.start)
        self._behind: float
        self._ahead: float
        self._hand = (0, 0.0)  # until when (ns) a hand turns it, and at which rad/s
        self._bracket()
        while self._ahead <= 0.0:  # the first flank of a disc may lie a little before its zero
            self._flank += 1
            self._bracket()
        self._begin()

    @property
    def level(self) -> int:
        """Level of the pin: 1 while a slot lies open, which it does after an odd flank."""
        return self._flank % 2

    def watch(self, on: bool) -> None:
        """From now on `changes` tells what the pin does, or no longer."""
        self._changes = deque() if on else None

    def changes(self, until: int) -> list[LevelChange]:
        """All that the watched pin did since the last call, until `until`; after `advance`."""
        found: list[LevelChange] = []
        while self._changes and self._changes[0].time <= until:
            found.append(self._changes.popleft())
        return found

    def turn_by_hand(self, angle: float, speed: float) -> int:
        """From now on a hand turns it by `angle` rad at `speed` rad/s. Returns its end, ns."""
        until = self.now + round(abs(angle) / speed * SECOND)
        self._hand = (until, speed if angle > 0.0 else -speed)
        self._begin()
        return until

    def advance(self, until: int, duty: float) -> Sequence[int]:
        """Drive with `duty` (-1 to 1) from `now` until `until`.

        Returns the times (ns) of the edges that count until then, in order.
        """
        if duty != self.duty or self.now == self._end:
            self.duty = duty
            self._begin()
        while until > self._end:
            self._move(self._end)
            self._begin()
        if self._end == NEVER:
            self.now = until
        elif until > self.now:
            self._move(until)
        return self._due(until) if self._pending else ()

    def _begin(self) -> None:
        """Start a stretch of exact exponential motion at `now`."""
        now, angle, speed, push = self.now, self.angle, self.speed, self.duty
        self._begun, self._angle = now, angle
        self._halts = False
        if now < self._hand[0]:
            self._settled, self._over = self._hand[1], 0.0
            self._end = min(self._hand[0], (now // GRID + 1) * GRID)
            self._halts = self._end == self._hand[0]
            return
        start = self.motor.start
        if speed == 0.0 and -start <= push <= start:
            self._settled = self._over = 0.0
            self._end = NEVER
            return
        if self._ripple:
            push *= 1.0 + self._ripple * sin(RIPPLE_CYCLES * angle + self._phase)
        if push > self._keep and speed >= 0.0:  # as by far the most stretches are
            settled = self._scale * (push - self._keep)
        else:
            settled = settled_speed(self.motor, push, speed)
        self._settled, self._over = settled, speed - settled
        self._end = (now // GRID + 1) * GRID
        # Only a slowing wheel can come to rest; look closer when it may within this stretch.
        if (settled > 0.0) != (speed > 0.0) or settled == 0.0:
            self._look_for_rest(speed, settled)

    def _look_for_rest(self, speed: float, settled: float) -> None:
        if speed == 0.0:
            return
        ratio = abs(speed) / REST if settled == 0.0 else (speed - settled) / -settled
        left = self.motor.lag * log(ratio) if ratio > 1.0 else 0.0
        end = self.now + int(left * SECOND) + 1
        if end <= self._end:
            self._end, self._halts = end, True

    def _move(self, until: int) -> None:
        """Follow the stretch until `until`, which lies within it."""
        settled, over, lag, span = self._settled, self._over, self._lag, until - self._begun
        past = span * 1e-9
        fade = self._fade if span == GRID else exp(-past / lag)
        self.speed = settled + over * fade
        angle = self._angle + settled * past + over * lag * (1.0 - fade)
        if angle >= self._ahead or angle < self._behind:
            self._cross(angle, past)
        self.angle = angle
        self.now = until
        if self._halts and until == self._end:
            self.speed = 0.0

    def _cross(self, angle: float, past: float) -> None:
        """Pass the flanks up to `angle`, which is reached `past` seconds into the stretch.

        Only those that count are timed, unless the pin is watched.
        """
        watched = self._changes is not None
        while angle >= self._ahead:
            if watched or self._flank % 2 == self._counted:
                self._mark(self._ahead, angle, past, 1 - self._flank % 2)
            self._flank += 1
            self._behind, self._ahead = self._ahead, self._place(self._flank)
        while angle < self._behind:
            self._flank -= 1
            if watched or self._flank % 2 != self._counted:
                self._mark(self._behind, angle, past, self._flank % 2)
            self._behind, self._ahead = self._place(self._flank - 1), self._behind

    def _mark(self, place: float, angle: float, past: float, level: int) -> None:
        """Note the flank at `place`, after which the pin is at `level`."""
        guess = past * (place - self._angle) / (angle - self._angle)
        time = self._begun + round(self._time_of(place, guess, past) * SECOND)
        if self._disc.jitter:
            # A light barrier can only be late. Twice the mean delay matters to nobody.
            time += int(abs(self._chance.gauss(0.0, self._disc.jitter)) * SECOND)
        times = [time]
        if self._disc.bounce:
            window = self._disc.bounce * SECOND
            times += sorted(time + int(self._chance.random() * window) for _ in range(CHATTER))
        if level != self._counted:
            if self._pending:
                times[0] = max(time, self._pending[-1])
            self._pending.extend(times)
        if self._changes is not None:
            self._change(times, level)

    def _change(self, times: list[int], level: int) -> None:
        """The pin goes to `level` at all these times, and in between goes back."""
        changes = self._changes
        assert changes is not None
        earliest = changes[-1].time if changes else 0
        for before, time in zip([None, *times], times, strict=False):
            if before is not None:
                changes.append(LevelChange(max(earliest, (before + time) // 2), 1 - level))
            changes.append(LevelChange(max(earliest, time), level))

    def _time_of(self, place: float, past: float, high: float) -> float:
        """Seconds from the stretch's start at which the angle is `place` (Newton, bracketed).

        `past` is a guess; at `high` seconds the place has been passed.
        """
        lag, settled, over, begun = self._lag, self._settled, self._over, self._angle
        low = 0.0
        forward = place >= begun
        for _ in range(60):  # bisection alone would need 30
            fade = exp(-past / lag)
            error = begun + settled * past + over * lag * (1.0 - fade) - place
            if (error > 0.0) == forward:
                high = past
            else:
                low = past
            speed = settled + over * fade
            step = error / speed if speed else inf
            following = past - step
            if not low <= following <= high:
                following = 0.5 * (low + high)
            if abs(following - past) < CLOSE:
                return following
            past = following
        return past

    def _bracket(self) -> None:
        """Find the angles of the flank passed last and of the one to come, going forward."""
        self._behind, self._ahead = self._place(self._flank - 1), self._place(self._flank)

    def _place(self, flank: int) -> float:
        turn, place = divmod(flank, len(self._disc.flanks))
        return self._disc.flanks[place] + turn * 2 * pi - self._disc.start

    def _due(self, until: int) -> list[int]:
        due = []
        while self._pending and self._pending[0] <= until:
            due.append(self._pending.popleft())
        return due


def settled_speed(motor: MotorModel, duty: float, speed: float) -> float:
    """Speed (rad/s) towards which a wheel tends that turns at `speed` and is driven with `duty`."""
    scale = motor.speed / (1.0 - motor.keep)
    if motor.coulomb and speed != 0.0:
        return scale * (duty - motor.keep if speed > 0.0 else duty + motor.keep)
    if duty > motor.keep:
        return scale * (duty - motor.keep)
    if duty < -motor.keep:
        return scale * (duty + motor.keep)
    return 0.0


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)
