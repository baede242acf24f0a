"""How one wheel moves under a known command, and how sure that is: the maths of a Kalman filter.

The state is (z, speed, gain, offset, log lag, phase). z is the disc's place under the light barrier
in pitches, phase is z at the start, unknown over one whole pitch, so that z - phase is the travel.
What reveals the phase is the motor's answer to a known command:

    d speed / dt = (gain * drive + offset * sgn(drive) - speed) / lag

where drive is what a usual motor settles at, beyond a usual friction. Undriven, some motors roll
out as their lag has it, d speed / dt = -speed / lag; others are braked by dry friction to the last,
d speed / dt = (-friction * sgn(speed) - speed) / lag. Lengths are pitches, times seconds. With the
state goes a `SlotErrors`, the errors of the disc's slots.
"""

from __future__ import annotations

from math import erf, exp, inf, log, pi, sqrt
from typing import NamedTuple

from diffbotctl.estimation.slot_errors import (
    ADOPTED_SD,
    KnownSlotErrors,
    MeasurementRow,
    SlotErrors,
    Slots,
    TransitionRows,
)

TURN = 2.0 * pi
PROBABILITY_MIN = 1e-6  # a bound this unlikely is taken as a plain measurement of its nearer end
UNIFORM_VARIANCE = 1.0 / 12.0  # of what is equally likely anywhere in one pitch
EDGE_SD_MIN = 0.004  # pitches; how well an edge marks its slot: the light barrier has some play
EDGE_TIME_SD = 50e-6  # s
# Entries of `Covariance`.
Z_Z, Z_PHASE, PHASE_PHASE = 0, 5, 20
DIAGONAL = (0, 6, 11, 15, 18, 20)
SPEED_ENTRIES = (1, 6, 7, 8, 9, 10)


class Priors(NamedTuple):
    """What is known of the motors and discs before the first move: standard deviations, as found on
    kits of this kind, of motors in rad/s, of discs in pitches."""

    lag: float = 0.10  # s, the middle
    lag_ratio: float = 0.27  # of the logarithm of the lag
    gain: float = 0.065
    offset: float = 0.22  # rad/s
    friction: float = 1.16  # rad/s, not a deviation: the speed that a usual dead band takes away
    creep: float = 0.094  # rad/s, not a deviation: without drive, friction ends what is slower
    model_noise: float = 0.28  # rad/s per square root of a second: what the model leaves out
    offset_drift: float = 0.016  # rad/s per square root of a second: how the offset wanders
    slot: float = 0.03  # pitches; place of an edge
    open_share: float = 0.05  # pitches; of the open share of a pitch
    open_share_error: float = 0.0  # pitches, not a deviation: what that share is beyond a half
    frame_time: float = 0.0  # s; of a frame's time
    command_time: float = 0.0  # s; of the time at which a command takes hold
    has_edge_times: bool = False  # no deviation: whether the board tells when edges came

    def in_pitches(self, slots: int) -> Priors:
        """The same with all speeds in pitches/s of a disc with `slots` slots."""
        scale = slots / TURN
        return self._replace(
            offset=self.offset * scale,
            friction=self.friction * scale,
            creep=self.creep * scale,
            model_noise=self.model_noise * scale,
            offset_drift=self.offset_drift * scale,
        )


Covariance = tuple[float, ...]
"""The 21 entries of the upper triangle of the covariance of the state, row by row.

Where they are unpacked, each is named by its two states: z, v (speed), g (gain), b (offset), l (log
lag), f (phase).
"""


class WheelKalman:
    """The state of one wheel, its covariance, and what is known of its disc."""

    __slots__ = (
        "covariance",
        "disc",
        "gain",
        "is_dry",
        "is_last_forward",
        "log_lag",
        "log_likelihood",
        "offset",
        "phase",
        "priors",
        "speed",
        "z",
        "z_shift",
    )

    def __init__(self, priors: Priors, slots: int) -> None:
        """`slots`: of the disc."""
        self.priors = priors = priors.in_pitches(slots)
        self.disc: Slots = SlotErrors(
            slots, priors.slot, priors.open_share, priors.open_share_error
        )
        self.z = self.phase = 0.5
        self.speed = self.offset = self.z_shift = 0.0
        self.gain = 1.0
        self.is_last_forward: bool | None = None  # direction in which the last edge was passed
        self.is_dry: bool | None = None  # braked by dry friction when undriven; none: not yet seen
        self.log_likelihood = 0.0  # of all that has been seen
        self.log_lag = log(priors.lag)
        covariance = [0.0] * 21
        covariance[Z_PHASE] = UNIFORM_VARIANCE
        variances = (
            UNIFORM_VARIANCE,
            0.0,
            priors.gain**2,
            priors.offset**2,
            priors.lag_ratio**2,
            UNIFORM_VARIANCE,
        )
        for entry, variance in zip(DIAGONAL, variances, strict=True):
            covariance[entry] = variance
        self.covariance: Covariance = tuple(covariance)

    @property
    def travel(self) -> float:
        """Pitches turned since the start."""
        return self.z - self.phase

    @property
    def variance(self) -> float:
        """Variance of `travel`, in square pitches."""
        covariance = self.covariance
        return covariance[Z_Z] - 2.0 * covariance[Z_PHASE] + covariance[PHASE_PHASE]

    @property
    def speed_variance(self) -> float:
        """(pitches/s)2"""
        return self.covariance[DIAGONAL[1]]

    def is_rolling(self, creeps: float) -> bool:
        """True when it is faster than `creeps` times what friction ends."""
        return abs(self.speed) > creeps * self.priors.creep

    def edge_variance(self, is_forward: bool) -> float:
        """Variance of z about an edge that is seen now, as it is known before."""
        priors = self.priors
        share_variance = 0.0 if is_forward else priors.open_share * priors.open_share
        return self.covariance[Z_Z] + priors.slot * priors.slot + share_variance

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
        self.z_shift += pitches

    @property
    def start(self) -> float:
        """The phase, counted as if never shifted."""
        return self.phase - self.z_shift

    def predict(self, span: float, drive: float) -> None:
        """Let `span` seconds pass under `drive` (pitches/s)."""
        sign = (drive > 0.0) - (drive < 0.0)
        if self.gain * drive * sign + self.offset <= 0.0:  # friction never pushes
            drive, sign = 0.0, 0
        speed = self.speed
        if speed == 0.0 and not drive:
            return
        if self.is_dry and speed * sign <= 0.0 and speed != 0.0:
            self._brake(span, drive)
            return
        self._move(span, drive, sign, is_driven=drive != 0.0)
        if not drive and abs(self.speed) < self.priors.creep:
            self._stop()

    def _brake(self, span: float, drive: float) -> None:
        """Dry friction works against the motion until that ends, and then as it would at rest."""
        direction = 1 if self.speed > 0.0 else -1
        # Against the motion stands all that the dead band takes, on both of its sides if driven.
        braking = abs(drive) + self.priors.friction * (2.0 if drive else 1.0)
        settled = self.gain * braking - self.offset
        if settled > 0.0:
            stop_time = exp(self.log_lag) * log(1.0 + abs(self.speed) / settled)
        else:
            stop_time, braking, direction = inf, 0.0, 0
        drive_against = -direction * braking
        self._move(min(stop_time, span), drive_against, direction, is_driven=False)
        if stop_time < span:
            self._stop()
            if drive:
                self.predict(span - stop_time, drive)

    def _move(self, span: float, drive: float, sign: int, is_driven: bool) -> None:
        """Follow the exponential towards gain * drive + offset * sign."""
        speed = self.speed
        lag = exp(self.log_lag)
        decay = exp(-span / lag)
        rise = 1.0 - decay
        speed_travel = lag * rise
        drive_travel = span - speed_travel
        excess = speed - self.gain * drive - self.offset * sign
        self.z += speed * span - excess * drive_travel
        self.speed = speed - excess * rise
        lag_decay = span * decay
        rows = (
            speed_travel,
            drive * drive_travel,
            sign * drive_travel,
            excess * (speed_travel - lag_decay),
            decay,
            drive * rise,
            sign * rise,
            excess * lag_decay / lag,
        )
        priors = self.priors
        offset_noise = priors.offset_drift * priors.offset_drift * span if is_driven else 0.0
        speed_noise = priors.model_noise * priors.model_noise * span
        self._predict_covariance(rows, speed_noise, span, offset_noise)

    def _stop(self) -> None:
        """Friction ends the motion; how far it still rolled hangs on a speed not known better."""
        lag = exp(self.log_lag)
        self.speed = 0.0
        covariance = list(self.covariance)
        covariance[Z_Z] += self.speed_variance * lag * lag
        for entry in SPEED_ENTRIES:
            covariance[entry] = 0.0
        self.covariance = tuple(covariance)
        self.disc.wheel_stopped()

    def _predict_covariance(
        self, rows: TransitionRows, noise: float, span: float, offset_noise: float
    ) -> None:
        """Turn the covariance P into F P F' + Q; F's rows of z and speed are `rows`.

        Written out, because it runs twice for each wheel and frame.
        """
        if not self.disc.is_fixed:
            self.disc.pending.add(rows)
        a, b, c, d, e, f, g, h = rows
        (zz, zv, zg, zb, zl, zf, vv, vg, vb, vl, vf, gg, gb, gl, gf, bb, bl, bf, ll, lf, ff) = (
            self.covariance
        )
        zz = zz + a * zv + b * zg + c * zb + d * zl
        zv = zv + a * vv + b * vg + c * vb + d * vl
        vv = e * vv + f * vg + g * vb + h * vl
        zg += a * vg + b * gg + c * gb + d * gl
        zb += a * vb + b * gb + c * bb + d * bl
        zl += a * vl + b * gl + c * bl + d * ll
        zf += a * vf + b * gf + c * bf + d * lf
        vg = e * vg + f * gg + g * gb + h * gl
        vb = e * vb + f * gb + g * bb + h * bl
        vl = e * vl + f * gl + g * bl + h * ll
        vf = e * vf + f * gf + g * bf + h * lf
        zz = zz + a * zv + b * zg + c * zb + d * zl + noise * span * span / 3.0
        zv = zv * e + f * zg + g * zb + h * zl + 0.5 * noise * span
        vv = vv * e + f * vg + g * vb + h * vl + noise
        bb += offset_noise
        self.covariance = (
            zz,
            zv,
            zg,
            zb,
            zl,
            zf,
            vv,
            vg,
            vb,
            vl,
            vf,
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

    def command_changed(self, change: float) -> None:
        """The drive changes by `change` (pitches/s) now, or a little earlier or later."""
        if self.priors.command_time:
            z_variance = self.covariance[Z_Z] + (change * self.priors.command_time) ** 2
            self.covariance = (z_variance, *self.covariance[1:])

    def update_edge(self, place: float, slot: int, is_forward: bool) -> None:
        """An edge of `slot` is under the light barrier, seen going forward or backward; nominally
        that is at `place`."""
        disc = self.disc
        if isinstance(disc, SlotErrors):
            disc.start_learning()
            if not disc.is_fixed:
                self._update_edge_and_slots(disc, place, slot, is_forward)
                return
        elif self.is_last_forward is not None and is_forward != self.is_last_forward:
            self._inflate(disc.edges.open_share.variance)
        self.is_last_forward = is_forward
        row = self._z_row()
        error, variance = disc.edge_estimate(slot, is_forward)
        innovation = place + error - self.z
        innovation_variance = row[0] + variance
        self._add_log_likelihood(innovation, innovation_variance)
        self._update(row, innovation / innovation_variance, 1.0 / innovation_variance)

    def _update_edge_and_slots(
        self, disc: SlotErrors, place: float, slot: int, is_forward: bool
    ) -> None:
        """Take in an edge while the slots' errors are learnt: what is seen is z less the error."""
        disc.propagate()
        index = disc.index(slot, is_forward)
        error_row, error_slot_row = disc.rows(index)
        slot_row = [
            z - error for z, error in zip(disc.cross_covariance[0], error_slot_row, strict=True)
        ]
        row = _minus(self._z_row(), error_row)
        fixed = disc.fixed_estimate(slot, is_forward)
        noise = fixed.variance or EDGE_SD_MIN * EDGE_SD_MIN + (self.speed * EDGE_TIME_SD) ** 2
        variance = row[0] - slot_row[index] + noise
        scaled_innovation = (place + disc.errors[index] + fixed.error - self.z) / variance
        self._add_log_likelihood(scaled_innovation * variance, variance)
        self._update(row, scaled_innovation, 1.0 / variance)
        disc.update(row, slot_row, scaled_innovation, 1.0 / variance)
        if index == 0:
            disc.stop_learning_if_known()

    def _inflate(self, variance: float) -> None:
        """Where the edges of the other direction lie against those before is known so badly: all
        that is counted in slots may be shifted, which leaves the travel as it is."""
        covariance = list(self.covariance)
        for entry in (Z_Z, Z_PHASE, PHASE_PHASE):
            covariance[entry] += variance
        self.covariance = tuple(covariance)

    def set_known_slots(self, known: KnownSlotErrors) -> None:
        """The disc turns out to be a `known` one: take in where its slots lie."""
        disc = self.disc
        assert isinstance(disc, SlotErrors)
        disc.backward_errors = known.backward_errors()
        disc.backward_variance = known.edges.backward_variance
        if disc.is_fixed:
            return
        disc.propagate()
        for slot in range(disc.slots):
            row, slot_row = disc.rows(slot)
            variance = slot_row[slot] + ADOPTED_SD * ADOPTED_SD
            innovation = known.edge_estimate(slot, True).error - disc.errors[slot]
            self._update(row, innovation / variance, 1.0 / variance)
            disc.update(row, slot_row, innovation / variance, 1.0 / variance)

    def update_bounds(self, low: float, high: float, outside_min: float) -> None:
        """z lies between `low` and `high`; believed when more than `outside_min` of the probability
        lay outside."""
        priors = self.priors
        variance = self.covariance[Z_Z] + priors.slot**2 + (self.speed * priors.frame_time) ** 2
        sd = sqrt(variance)
        below = (low - self.z) / sd
        above = (high - self.z) / sd
        probability = normal_cdf(above) - normal_cdf(below)
        if probability > 1.0 - outside_min:
            return
        self.log_likelihood += log(max(probability, PROBABILITY_MIN))
        if probability < PROBABILITY_MIN:
            nearer = low if below > 0.0 else high
            self._update_z((nearer - self.z) / variance, 1.0 / variance)
            return
        mean, remaining_variance = truncated_normal(below, above, probability)
        self._update_z(mean / sd, (1.0 - remaining_variance) / variance)

    def _add_log_likelihood(self, innovation: float, variance: float) -> None:
        self.log_likelihood -= 0.5 * (innovation * innovation / variance + log(variance))

    def _update_z(self, scaled_innovation: float, inverse_variance: float) -> None:
        """Take in a measurement of z itself."""
        row, disc = self._z_row(), self.disc
        self._update(row, scaled_innovation, inverse_variance)
        if not disc.is_fixed:
            disc.propagate()
            disc.update(row, disc.cross_covariance[0], scaled_innovation, inverse_variance)

    def _z_row(self) -> MeasurementRow:
        return self.covariance[:6]

    def _update(
        self, row: MeasurementRow, scaled_innovation: float, inverse_variance: float
    ) -> None:
        """Kalman update by a measured quantity: `row` is its covariance with the state.

        The state moves by row * `scaled_innovation` (the innovation over its variance), the
        covariance loses row row' * `inverse_variance`. Written out as in `_predict_covariance`.
        """
        z, v, g, b, lag, f = row
        self.z += z * scaled_innovation
        self.speed += v * scaled_innovation
        self.gain += g * scaled_innovation
        self.offset += b * scaled_innovation
        self.log_lag += lag * scaled_innovation
        self.phase += f * scaled_innovation
        (zz, zv, zg, zb, zl, zf, vv, vg, vb, vl, vf, gg, gb, gl, gf, bb, bl, bf, ll, lf, ff) = (
            self.covariance
        )
        zc, vc, gc = z * inverse_variance, v * inverse_variance, g * inverse_variance
        bc, lc, fc = b * inverse_variance, lag * inverse_variance, f * inverse_variance
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
            ff - fc * f,
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
