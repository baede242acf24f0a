"""How one wheel moves under a known command, and how sure that is: the maths of a Kalman filter.

The state is (z, speed, gain, offset, log lag, phase). z is the disc's place under the light barrier
in pitches, phase is z at the start, unknown over one whole pitch, so that z - phase is the travel.
What reveals the phase is the motor's answer to a known command:

    d speed / dt = (gain * drive + offset * sgn(drive) - speed) / lag

where drive is what a usual motor settles at, beyond a usual friction. Undriven, some motors roll
out as their lag has it, d speed / dt = -speed / lag; others are braked by dry friction to the last,
d speed / dt = (-friction * sgn(speed) - speed) / lag. Lengths are pitches, times seconds. With the
state goes a `SlotPlaces`, the errors of the disc's slots.
"""

from __future__ import annotations

from math import erf, exp, inf, log, pi, sqrt
from typing import NamedTuple

from diffbotctl.estimation.known_slot_errors import TAKEN, KnownSlotErrors, Slots
from diffbotctl.estimation.slot_errors import MeasurementRow, SlotErrors
from diffbotctl.estimation.wheel_transition import Factors

TURN = 2.0 * pi
MIN_PROBABILITY = 1e-6  # a bound this unlikely is taken as a plain measurement of its nearer end
UNIFORM = 1.0 / 12.0  # variance of what is equally likely anywhere in one pitch
EDGE_VARIANCE_FLOOR = (
    0.004  # pitches; how well an edge marks its own flank: the light barrier has a little play
)
LATE = 50e-6  # s; how well its time does


class Priors(NamedTuple):
    """What is known of the motors and discs before the first move: standard deviations, as found on
    kits of this kind, of motors in rad/s, of discs in pitches."""

    lag: float = 0.10  # s, the middle
    lag_ratio: float = 0.27  # of the logarithm of the lag
    gain: float = 0.065
    offset: float = 0.22  # rad/s
    friction: float = 1.16  # rad/s, not a deviation: the speed that a usual dead band takes away
    creep: float = 0.094  # rad/s, not a deviation: without drive, friction ends what is slower
    rough: float = 0.28  # rad/s per square root of a second: what the model leaves out
    drift: float = 0.016  # rad/s per square root of a second: how the offset wanders
    slot: float = 0.03  # pitches; place of an edge
    open: float = 0.05  # pitches; of the open share of a pitch
    share: float = 0.0  # pitches, not a deviation: what that share is beyond a half
    stamp: float = 0.0  # s; of a frame's time
    hold: float = 0.0  # s; of the time at which a command takes hold
    timed: bool = False  # no deviation: whether the board tells when edges came

    def in_pitches(self, slots: int) -> Priors:
        """The same with all speeds in pitches/s of a disc with `slots` slots."""
        scale = slots / TURN
        return self._replace(
            offset=self.offset * scale,
            friction=self.friction * scale,
            creep=self.creep * scale,
            rough=self.rough * scale,
            drift=self.drift * scale,
        )


Covariance = tuple[
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
    float,
]
"""The upper triangle of the covariance of the state, row by row."""


class WheelKalman:
    """The state of one wheel, its covariance, and what is known of its disc."""

    __slots__ = (
        "ahead",
        "covariance",
        "disc",
        "dry",
        "evidence",
        "gain",
        "log_lag",
        "offset",
        "phase",
        "shifted",
        "speed",
        "spread",
        "z",
    )

    def __init__(self, spread: Priors, slots: int) -> None:
        """`slots`: of the disc."""
        self.spread = spread = spread.in_pitches(slots)
        self.disc: Slots = SlotErrors(slots, spread.slot, spread.open, spread.share)
        self.z = self.phase = 0.5
        self.speed = self.offset = self.shifted = 0.0
        self.gain = 1.0
        self.ahead: bool | None = None  # direction in which the last edge was passed
        self.dry: bool | None = None  # braked by dry friction when undriven; none: not yet seen
        self.evidence = 0.0  # logarithm of how likely all was that has been seen
        self.log_lag = log(spread.lag)
        self.covariance: Covariance = (
            UNIFORM,
            0.0,
            0.0,
            0.0,
            0.0,
            UNIFORM,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            spread.gain**2,
            0.0,
            0.0,
            0.0,
            spread.offset**2,
            0.0,
            0.0,
            spread.lag_ratio**2,
            0.0,
            UNIFORM,
        )

    @property
    def travel(self) -> float:
        """Pitches turned since the start."""
        return self.z - self.phase

    @property
    def variance(self) -> float:
        """Variance of `travel`, in square pitches."""
        covariance = self.covariance
        return covariance[0] - 2.0 * covariance[5] + covariance[20]

    @property
    def speed_variance(self) -> float:
        """(pitches/s)2"""
        return self.covariance[6]

    def rolls(self, creeps: float) -> bool:
        """True when it is faster than `creeps` times what friction ends."""
        return abs(self.speed) > creeps * self.spread.creep

    def flank_variance(self, forward: bool) -> float:
        """Variance of z about a flank that is seen now, as it is known before."""
        spread = self.spread
        far = 0.0 if forward else spread.open * spread.open
        return self.covariance[0] + spread.slot * spread.slot + far

    def copy(self) -> WheelKalman:
        """The same, to go its own way from now on."""
        twin = object.__new__(WheelKalman)
        for name in WheelKalman.__slots__:
            setattr(twin, name, getattr(self, name))
        twin.disc = self.disc.copy()
        return twin

    def shift(self, pitches: float) -> None:
        """Count z from another slot or flank."""
        self.z += pitches
        self.phase += pitches
        self.shifted += pitches

    @property
    def start(self) -> float:
        """The phase, counted as if never shifted."""
        return self.phase - self.shifted

    def run(self, span: float, drive: float) -> None:
        """Let `span` seconds pass under `drive` (pitches/s)."""
        spread, sign = self.spread, (drive > 0.0) - (drive < 0.0)
        if self.gain * drive * sign + self.offset <= 0.0:  # friction never pushes
            drive, sign = 0.0, 0
        speed = self.speed
        if speed == 0.0 and not drive:
            return
        rolls_on = speed * sign <= 0.0 and speed != 0.0
        if rolls_on and self.dry:
            self._brake(span, drive)
            return
        self._move(span, drive, sign, driven=drive != 0.0)
        if not drive and abs(self.speed) < spread.creep:
            self._halt()

    def _brake(self, span: float, drive: float) -> None:
        """Dry friction works against the motion until that ends, and then as it would at rest."""
        way = 1 if self.speed > 0.0 else -1
        # Against the motion stands all that the dead band takes, on both of its sides if driven.
        against = abs(drive) + self.spread.friction * (2.0 if drive else 1.0)
        settled = self.gain * against - self.offset
        if settled <= 0.0:
            settled = against = 0.0
        left = exp(self.log_lag) * log(1.0 + abs(self.speed) / settled) if settled else inf
        self._move(min(left, span), -way * against, way if settled else 0, driven=False)
        if left < span:
            self._halt()
            if drive:
                self.run(span - left, drive)

    def _move(self, span: float, drive: float, sign: int, driven: bool) -> None:
        """Follow the exponential towards gain * drive + offset * sign."""
        speed = self.speed
        lag = exp(self.log_lag)
        fade = exp(-span / lag)
        rise = 1.0 - fade
        slide = lag * rise
        rest = span - slide
        over = speed - self.gain * drive - self.offset * sign
        self.z += speed * span - over * rest
        self.speed = speed - over * rise
        by_lag = span * fade
        factors = (
            slide,
            drive * rest,
            sign * rest,
            over * (slide - by_lag),
            fade,
            drive * rise,
            sign * rise,
            over * by_lag / lag,
        )
        spread = self.spread
        wander = spread.drift * spread.drift * span if driven else 0.0
        self._spread_out(factors, spread.rough * spread.rough * span, span, wander)

    def _halt(self) -> None:
        """Friction ends the motion; how far it still rolled hangs on a speed not known better."""
        lag = exp(self.log_lag)
        self.speed = 0.0
        (zz, _, zg, zb, zl, zf, vv, _, _, _, _, gg, gb, gl, gf, bb, bl, bf, ll, lf, ff) = (
            self.covariance
        )
        self.covariance = (
            zz + vv * lag * lag,
            0.0,
            zg,
            zb,
            zl,
            zf,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            gg,
            gb,
            gl,
            gf,
            bb,
            bl,
            bf,
            ll,
            lf,
            ff,
        )
        self.disc.halt()

    def _spread_out(self, factors: Factors, noise: float, span: float, wander: float) -> None:
        """Turn the covariance P into F P F' + Q; F's rows of z and speed are `factors`.

        Written out, because it runs twice for each wheel and frame.
        """
        if not self.disc.learnt:
            self.disc.waiting.add(factors)
        a, b, c, d, e, f, g, h = factors
        (zz, zv, zg, zb, zl, zf, vv, vg, vb, vl, vf, gg, gb, gl, gf, bb, bl, bf, ll, lf, ff) = (
            self.covariance
        )
        along = zz + a * zv + b * zg + c * zb + d * zl
        cross = zv + a * vv + b * vg + c * vb + d * vl
        kept = e * vv + f * vg + g * vb + h * vl
        zg += a * vg + b * gg + c * gb + d * gl
        zb += a * vb + b * gb + c * bb + d * bl
        zl += a * vl + b * gl + c * bl + d * ll
        zf += a * vf + b * gf + c * bf + d * lf
        vg = e * vg + f * gg + g * gb + h * gl
        vb = e * vb + f * gb + g * bb + h * bl
        vl = e * vl + f * gl + g * bl + h * ll
        vf = e * vf + f * gf + g * bf + h * lf
        self.covariance = (
            along + a * cross + b * zg + c * zb + d * zl + noise * span * span / 3.0,
            cross * e + f * zg + g * zb + h * zl + 0.5 * noise * span,
            zg,
            zb,
            zl,
            zf,
            kept * e + f * vg + g * vb + h * vl + noise,
            vg,
            vb,
            vl,
            vf,
            gg,
            gb,
            gl,
            gf,
            bb + wander,
            bl,
            bf,
            ll,
            lf,
            ff,
        )

    def turn(self, change: float) -> None:
        """The drive changes by `change` (pitches/s) now, or a little earlier or later."""
        if self.spread.hold:
            first = self.covariance[0] + (change * self.spread.hold) ** 2
            self.covariance = (first, *self.covariance[1:])

    def see_edge(self, place: float, slot: int, forward: bool) -> None:
        """A flank of `slot` is under the light barrier, seen going `forward` or backward; nominally
        that is at `place`."""
        disc, row = self.disc, self._row()
        disc.begin()
        if disc.learnt:
            if (
                isinstance(disc, KnownSlotErrors)
                and self.ahead is not None
                and forward != self.ahead
            ):
                self._loosen(disc.flanks.beyond.variance)
            self.ahead = forward
            row = self._row()
            error, variance = disc.told(slot, forward)
            whole = row[0] + variance
            self._note(place + error - self.z, whole)
            self._absorb(row, (place + error - self.z) / whole, 1.0 / whole)
            return
        assert isinstance(disc, SlotErrors)
        disc.carry()
        entry = disc.entry(slot, forward)
        shared, own = disc.with_entry(entry)
        # What is seen is z less the flank's error.
        slots = [p - q for p, q in zip(disc.shared[0], own, strict=True)]
        motion = _minus(row, shared)
        alone = disc.alone(slot, forward)
        noise = (
            alone.variance or EDGE_VARIANCE_FLOOR * EDGE_VARIANCE_FLOOR + (self.speed * LATE) ** 2
        )
        whole = motion[0] - slots[entry] + noise
        pull = (place + disc.error[entry] + alone.error - self.z) / whole
        self._note(pull * whole, whole)
        self._absorb(motion, pull, 1.0 / whole)
        disc.absorb(motion, slots, pull, 1.0 / whole)
        if entry == 0:
            disc.settle()

    def _loosen(self, variance: float) -> None:
        """Where the flanks of the other direction lie against those before is known so badly: all
        that is counted in slots may be shifted, which leaves the travel as it is."""
        covariance = list(self.covariance)
        for entry in (0, 5, 20):  # z and phase, and both together
            covariance[entry] += variance
        self.covariance = tuple(covariance)  # type: ignore[assignment]

    def know(self, known: Slots) -> None:
        """The disc turns out to be a `known` one: take in where its slots lie."""
        disc = self.disc
        assert isinstance(disc, SlotErrors) and isinstance(known, KnownSlotErrors)
        disc.back, disc.back_variance = known.beyond()
        if disc.learnt:
            return
        disc.carry()
        for slot in range(disc.slots):
            self._see_slot(slot, known.told(slot, True).error, TAKEN * TAKEN)

    def _see_slot(self, entry: int, error: float, variance: float) -> None:
        """The slots' error of number `entry` is known from elsewhere."""
        disc = self.disc
        assert isinstance(disc, SlotErrors)
        shared, own = disc.with_entry(entry)
        whole = own[entry] + variance
        pull = (error - disc.error[entry]) / whole
        self._absorb(shared, pull, 1.0 / whole)
        disc.absorb(shared, own, pull, 1.0 / whole)

    def see_bounds(self, low: float, high: float, least: float) -> None:
        """z lies between `low` and `high`; believed when more than `least` of it lay outside."""
        spread = self.spread
        whole = self.covariance[0] + spread.slot**2 + (self.speed * spread.stamp) ** 2
        deviation = sqrt(whole)
        below = (low - self.z) / deviation
        above = (high - self.z) / deviation
        mass = normal_cdf(above) - normal_cdf(below)
        if mass > 1.0 - least:
            return
        self.evidence += log(max(mass, MIN_PROBABILITY))
        if mass < MIN_PROBABILITY:
            nearer = low if below > 0.0 else high
            self._learn((nearer - self.z) / whole, 1.0 / whole)
            return
        shift, left = truncated_normal(below, above, mass)
        self._learn(shift / deviation, (1.0 - left) / whole)

    def _note(self, surprise: float, variance: float) -> None:
        self.evidence -= 0.5 * (surprise * surprise / variance + log(variance))

    def _learn(self, pull: float, cut: float) -> None:
        """Take in what was seen of z itself."""
        row, disc = self._row(), self.disc
        self._absorb(row, pull, cut)
        if not disc.learnt:
            assert isinstance(disc, SlotErrors)
            disc.carry()
            disc.absorb(row, disc.shared[0], pull, cut)

    def _row(self) -> MeasurementRow:
        return self.covariance[:6]

    def _absorb(self, row: MeasurementRow, pull: float, cut: float) -> None:
        """Move the state by `row` times `pull`, take row row' times `cut` from the covariance."""
        z, v, g, b, lag, f = row
        self.z += z * pull
        self.speed += v * pull
        self.gain += g * pull
        self.offset += b * pull
        self.log_lag += lag * pull
        self.phase += f * pull
        (zz, zv, zg, zb, zl, zf, vv, vg, vb, vl, vf, gg, gb, gl, gf, bb, bl, bf, ll, lf, ff) = (
            self.covariance
        )
        zc, vc, gc, bc, lc = z * cut, v * cut, g * cut, b * cut, lag * cut
        self.covariance = (
            zz - zc * z,
            zv - zc * v,
            zg - zc * g,
            zb - zc * b,
            zl - zc * lag,
            zf - zc * f,
            vv - vc * v,
            vg - vc * g,
            vb - vc * b,
            vl - vc * lag,
            vf - vc * f,
            gg - gc * g,
            gb - gc * b,
            gl - gc * lag,
            gf - gc * f,
            bb - bc * b,
            bl - bc * lag,
            bf - bc * f,
            ll - lc * lag,
            lf - lc * f,
            ff - f * cut * f,
        )


def _minus(one: MeasurementRow, other: MeasurementRow) -> MeasurementRow:
    a, b, c, d, e, f = one
    p, q, r, s, t, u = other
    return (a - p, b - q, c - r, d - s, e - t, f - u)


def normal_cdf(value: float) -> float:
    """The standard normal distribution's mass below `value`."""
    return 0.5 * (1.0 + erf(value * 0.7071067811865476))


def truncated_normal(below: float, above: float, mass: float) -> tuple[float, float]:
    """Mean and variance of a standard normal cut to (below, above), which holds `mass`."""
    at_below = exp(-0.5 * below * below) / sqrt(2.0 * pi)
    at_above = exp(-0.5 * above * above) / sqrt(2.0 * pi)
    mean = (at_below - at_above) / mass
    variance = 1.0 + (below * at_below - above * at_above) / mass - mean * mean
    return mean, max(variance, 0.0)
