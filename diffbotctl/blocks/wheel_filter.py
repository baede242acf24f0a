"""How far a wheel has turned, finer than its encoder's slots: a Kalman filter on the motor's model.

The state of a wheel is (z, speed, gain, offset, log lag, phase). z is the disc's place under the
light barrier in pitches; going forward a rising edge comes at each whole z, going backward at each
whole z plus the open share of the pitch. phase is z at the start, unknown over one whole pitch, so
that z - phase is the travel. What reveals the phase is the motor's answer to a known command:

    d speed / dt = (gain * drive + offset * sgn(drive) - speed) / lag

Lengths are pitches, times seconds inside and integer nanoseconds at the door.
"""

from __future__ import annotations

from math import erf, exp, floor, log, pi, sqrt
from typing import NamedTuple

Z, SPEED, GAIN, OFFSET, LAG, PHASE = range(6)
OPEN = 0.5  # share of the pitch that lies open: where edges come when going backward
CREEP = 0.3  # pitches/s (3 mm/s); slower than this the sign of the drive tells the direction
DOUBT = 1.2  # pitches/s (12 mm/s); slower after a reversal, the sign of the speed is a guess
OUTSIDE = 0.08  # mass beyond a bound from which on it is believed; less says nothing new at rest
LEAST_MASS = 1e-6  # a bound this unlikely is taken as a plain measurement of its nearer end


class Spread(NamedTuple):
    """What is known of the motors and discs before the first move. Standard deviations."""

    lag: float = 0.10  # s, the middle
    lag_ratio: float = 0.27  # of the logarithm of the lag
    gain: float = 0.065
    offset: float = 0.7  # pitches/s
    slot: float = 0.03  # pitches; place of an edge
    open: float = 0.05  # pitches; of OPEN
    stamp: float = 0.0  # s; of a frame's time
    rough: float = 0.8  # pitches/s per square root of a second: what the model leaves out
    drift: float = 0.3  # pitches/s per square root of a second: how the offset wanders


class WheelFilter:
    """One wheel. `travel` (pitches since the start), `speed` (pitches/s) and `variance`."""

    def __init__(self, spread: Spread, time: int, count: int) -> None:
        self.spread = spread
        self.time = time
        self.count = count
        self.drive = 0.0
        self.state = [0.5, 0.0, 1.0, 0.0, log(spread.lag), 0.5]
        phase = 1.0 / 12.0  # variance of a phase that is uniform over one pitch
        self.covariance = [[0.0] * 6 for _ in range(6)]
        for row, variance in (
            (Z, phase), (PHASE, phase), (GAIN, spread.gain**2), (OFFSET, spread.offset**2),
            (LAG, spread.lag_ratio**2),
        ):  # fmt: skip
            self.covariance[row][row] = variance
        self.covariance[Z][PHASE] = self.covariance[PHASE][Z] = phase
        self.heading = 0  # direction of the last drive: 1, -1, or 0 before the first
        self.place = 0.0  # z of the last edge
        self.passed = 0  # direction in which it was passed
        self.turned_back = False  # driven the other way since then

    @property
    def travel(self) -> float:
        """Pitches turned since the start."""
        return self.state[Z] - self.state[PHASE]

    @property
    def speed(self) -> float:
        """Pitches per second."""
        return self.state[SPEED]

    @property
    def variance(self) -> float:
        """Variance of `travel`, in square pitches."""
        covariance = self.covariance
        return covariance[Z][Z] - 2.0 * covariance[Z][PHASE] + covariance[PHASE][PHASE]

    def frame(
        self, time: int, count: int, edge: int | None, drive: float, since: int | None
    ) -> None:
        """Take one frame: `count` at `time`, the last edge's time if the board tells it, and the
        `drive` (pitches/s wanted) in force, `since` when if known."""
        steps = count - self.count
        self.count = count
        marked = edge is not None and steps != 0
        changes = drive != self.drive
        switch = self._clamp(since, time) if changes else time
        passed = self._clamp(edge, time) if marked else time
        if changes and switch <= passed:
            self._advance(switch)
            self._turn(drive)
        if marked:
            self._advance(passed)
            self._pass(steps)
            self._measure(self.place)
        if changes and switch > passed:
            self._advance(switch)
            self._turn(drive)
        self._advance(time)
        if steps and not marked:
            self._pass(steps)
        self._bound(moving=not marked and (steps != 0 or abs(self.state[SPEED]) > CREEP))

    def _clamp(self, moment: int | None, time: int) -> int:
        return self.time if moment is None else min(max(moment, self.time), time)

    def _turn(self, drive: float) -> None:
        """The command changes to `drive`."""
        self.drive = drive
        if drive == 0.0:
            return
        heading = 1 if drive > 0.0 else -1
        if self.heading == 0 and self.passed == 0:
            self.passed = heading
            if heading < 0:  # the phase is as unknown against the edges that come going backward
                self.state[Z] -= OPEN
                self.state[PHASE] -= OPEN
                self.place = OPEN
        self.heading = heading
        if heading != self.passed:
            self.turned_back = True

    def _pass(self, steps: int) -> None:
        """`steps` edges have been passed (the board's sign is not believed)."""
        speed, z = self.state[SPEED], self.state[Z]
        heading = self.heading or (1 if steps > 0 else -1)
        if abs(speed) > CREEP:
            heading = 1 if speed > 0.0 else -1
        if heading == self.passed and not self.turned_back:
            self.place += heading * abs(steps)
        else:
            forward, backward = floor(z + 0.5), floor(z - OPEN + 0.5) + OPEN
            if abs(speed) < DOUBT:  # it may still roll the old way: the nearer edge decides
                heading = 1 if abs(forward - z) <= abs(backward - z) else -1
            self.place = forward if heading > 0 else backward
        self.passed = heading
        self.turned_back = self.heading != heading

    def _advance(self, time: int) -> None:
        """Let the motor run on to `time` under the drive in force."""
        span = (time - self.time) * 1e-9
        self.time = time
        if span <= 0.0:
            return
        state, covariance, drive = self.state, self.covariance, self.drive
        _, speed, gain, offset, log_lag, _ = state
        sign = (drive > 0.0) - (drive < 0.0)
        lag = exp(log_lag)
        fade = exp(-span / lag)
        slide = lag * (1.0 - fade)
        rest = span - slide
        over = speed - gain * drive - offset * sign
        state[Z] += speed * span - over * rest
        state[SPEED] = speed - over * (1.0 - fade)
        rise = 1.0 - fade
        by_lag = span * fade
        # The rows of F that are not the identity's; gain, offset, lag and phase stand still.
        to_z = (slide, drive * rest, sign * rest, over * (slide - by_lag))
        to_speed = (fade, drive * rise, sign * rise, over * by_lag / lag)
        _spread(covariance, to_z, to_speed)
        spread = self.spread
        if drive or abs(state[SPEED]) > CREEP:
            noise = spread.rough * spread.rough * span
            covariance[SPEED][SPEED] += noise
            covariance[Z][SPEED] += 0.5 * noise * span
            covariance[SPEED][Z] = covariance[Z][SPEED]
            covariance[Z][Z] += noise * span * span / 3.0
        if drive:
            covariance[OFFSET][OFFSET] += spread.drift * spread.drift * span

    def _measure(self, place: float) -> None:
        """z is at `place` now, as well as slots are cut."""
        spread = self.spread
        noise = spread.slot**2 + (spread.open**2 if self.turned_back else 0.0)
        variance = self.covariance[Z][Z]
        share = variance / (variance + noise)
        self._absorb((place - self.state[Z]) * share, 1.0 - share)

    def _bound(self, moving: bool) -> None:
        """No further edge has come: z lies within bounds."""
        if self.passed == 0:
            return
        low, high = bounds(self.place, self.passed, self.turned_back)
        spread = self.spread
        soft = spread.slot**2 + (self.state[SPEED] * spread.stamp) ** 2
        variance = self.covariance[Z][Z]
        deviation = sqrt(variance + soft)
        below = (low - self.state[Z]) / deviation
        above = (high - self.state[Z]) / deviation
        mass = cumulated(above) - cumulated(below)
        if mass > 1.0 - (0.001 if moving else OUTSIDE):
            return
        if mass < LEAST_MASS:
            nearer = low if below > 0.0 else high
            share = variance / (variance + soft)
            self._absorb((nearer - self.state[Z]) * share, 1.0 - share)
            return
        shift, kept = truncated(below, above, mass)
        share = variance / (variance + soft)
        self._absorb(share * deviation * shift, 1.0 - share * (1.0 - kept))

    def _absorb(self, shift: float, kept: float) -> None:
        """Move z by `shift` and leave `kept` of its variance; the rest follows by correlation."""
        state, covariance = self.state, self.covariance
        row = covariance[Z]
        variance = row[Z]
        if variance <= 0.0:
            return
        pull = shift / variance
        for i in range(6):
            state[i] += row[i] * pull
        cut = (1.0 - kept) / variance
        a, b, c, d, e, f = row
        for line, value in zip(covariance, (a, b, c, d, e, f), strict=True):
            factor = value * cut
            if factor:
                line[0] -= factor * a
                line[1] -= factor * b
                line[2] -= factor * c
                line[3] -= factor * d
                line[4] -= factor * e
                line[5] -= factor * f


def bounds(place: float, passed: int, turned_back: bool) -> tuple[float, float]:
    """Where z can lie when the last edge stood at `place` and was `passed` forward (1) or backward.

    Turned back since, the next edge may come from either flank of the slot, so both count.
    """
    if passed > 0:
        return place - (1.0 - OPEN if turned_back else 0.0), place + 1.0
    return place - 1.0, place + (1.0 - OPEN if turned_back else 0.0)


def cumulated(value: float) -> float:
    """The standard normal distribution's mass below `value`."""
    return 0.5 * (1.0 + erf(value * 0.7071067811865476))


def truncated(below: float, above: float, mass: float) -> tuple[float, float]:
    """Mean and variance of a standard normal cut to (below, above), which holds `mass`."""
    at_below = exp(-0.5 * below * below) / sqrt(2.0 * pi)
    at_above = exp(-0.5 * above * above) / sqrt(2.0 * pi)
    mean = (at_below - at_above) / mass
    variance = 1.0 + (below * at_below - above * at_above) / mass - mean * mean
    return mean, max(variance, 0.0)


Row = tuple[float, float, float, float]


def _spread(covariance: list[list[float]], to_z: Row, to_speed: Row) -> None:
    """Turn the covariance P into F P F'. F's row of z is (1, *to_z, 0), of speed (0, *to_speed, 0).

    Written out, because it runs twice for each wheel and frame.
    """
    b, c, d, e = to_z
    f, g, h, k = to_speed
    z, v, gain, offset, lag, phase = covariance
    v0, v1, v2, v3, v4, v5 = v
    g0, g1, g2, g3, g4, g5 = gain
    o0, o1, o2, o3, o4, o5 = offset
    l0, l1, l2, l3, l4, l5 = lag
    z0 = z[0] + b * v0 + c * g0 + d * o0 + e * l0
    z1 = z[1] + b * v1 + c * g1 + d * o1 + e * l1
    z2 = z[2] + b * v2 + c * g2 + d * o2 + e * l2
    z3 = z[3] + b * v3 + c * g3 + d * o3 + e * l3
    z4 = z[4] + b * v4 + c * g4 + d * o4 + e * l4
    z5 = z[5] + b * v5 + c * g5 + d * o5 + e * l5
    s1 = f * v1 + g * g1 + h * o1 + k * l1
    s2 = f * v2 + g * g2 + h * o2 + k * l2
    s3 = f * v3 + g * g3 + h * o3 + k * l3
    s4 = f * v4 + g * g4 + h * o4 + k * l4
    s5 = f * v5 + g * g5 + h * o5 + k * l5
    zs = z1 * f + z2 * g + z3 * h + z4 * k
    z[:] = (z0 + z1 * b + z2 * c + z3 * d + z4 * e, zs, z2, z3, z4, z5)
    v[:] = (zs, s1 * f + s2 * g + s3 * h + s4 * k, s2, s3, s4, s5)
    gain[0], gain[1] = z2, s2
    offset[0], offset[1] = z3, s3
    lag[0], lag[1] = z4, s4
    phase[0], phase[1] = z5, s5
