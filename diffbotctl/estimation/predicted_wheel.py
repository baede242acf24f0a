"""State of one wheel and its motor, and how it moves by the duty of the motor.

The state is (z, speed, gain, offset, log lag, phase). z is the position of the disc under the light
barrier in pitches; phase is z at the start, unknown within one pitch; z - phase is the travel. The
response of the motor to a known command makes the phase observable:

    d speed / dt = (gain * drive + offset * sgn(drive) - speed) / lag

drive is the speed at which a typical motor settles with this command, after its friction. Without
drive, some motors coast with their lag, d speed / dt = -speed / lag; others are braked by dry
friction, d speed / dt = (-friction * sgn(speed) - speed) / lag. Lengths are pitches, times seconds.
The errors of the disc's slots extend the state (`SlotErrors`).

That is a motor whose driver shorts its windings between two pulses. Where they free-wheel instead
(an L298N with PWM on its enable pin), no current brakes the motor between the pulses, and with the
duty u the torque, in units of the stall torque, is u * (1 - speed / no-load speed) - friction:

    d speed / dt = ((1 + viscous) * (gain * drive + offset * sgn(drive)) - (u + viscous) *
        speed) / L

with L the lag at full duty. At a low duty it settles slowly, and without drive dry friction alone
stops it.
"""

from __future__ import annotations

from copy import copy
from enum import IntEnum
from math import exp, inf, log, sqrt
from typing import Self

from diffbotctl.control.motor_curve import LAG_DUTY, VISCOUS
from diffbotctl.estimation.slot_errors import SlotErrors, TransitionRows
from diffbotctl.estimation.wheel_side import WIDE_NOISE_RATIO, Priors

UNIFORM_VARIANCE = 1.0 / 12.0  # of a uniform distribution over one pitch
FRAME_TIME_MAX = 0.002  # s; of a board that reports the time of its frames
SUSPECT_NOISE = 4.0  # times the usual variance, above which faults of the encoder are likely
# Standard deviations of the prior up to which an offset is friction. A larger one was learnt from a
# sudden change, which may have been one of the gain or of the encoder.
UNUSUAL_OFFSET_SDS = 2.0
RELEASED_RATIO = 0.5  # of the drive's speed, of a wheel that friction was taken to hold
ELAPSED_MIN = 0.005  # s; a motion does not change faster
# Edges since a wheel was at rest, before which its motion changes suddenly with a higher
# probability, one in 4.5 (minus its log): friction lets it go at a duty that differs from start to
# start, and on the floor, under the weight of the robot, at a higher one than with raised wheels.
STARTING_EDGES, STARTING_CHANGE_COST = 4, 1.5
# Factor of the noise's variance of such a motor while its driver shorts it: its lag is then not the
# one that was learnt from the drive, and the braking is known to a quarter.
SHORTED_NOISE = 25.0
# Entries of `Covariance`.
Z_Z, Z_SPEED, Z_PHASE, PHASE_PHASE = 0, 1, 5, 20
DIAGONAL = (0, 6, 11, 15, 18, 20)
SPEED_ENTRIES = (1, 6, 7, 8, 9, 10)


Covariance = tuple[float, ...]
"""The 21 entries of the upper triangle of the covariance of the state, row by row.

Where they are unpacked, each is named by its two states: z, v (speed), g (gain), b (offset), l (log
lag), f (phase).
"""


def no_load_speed(settled: float) -> float:
    """Speed of a free-wheeling motor without its viscous friction; with it, it settles at
    `settled`."""
    return (1.0 + VISCOUS) * settled


class MotorKind(IntEnum):
    """How a motor responds to its duty."""

    LINEAR = 0
    """shorted between the driver's pulses: the speed is linear in the duty, the lag constant"""
    FREE_WHEELING = 1  # without current between the pulses
    UNUSUAL_LINEAR = 2  # with wide priors
    UNUSUAL_FREE_WHEELING = 3


class PredictedWheel:
    """State and covariance of one wheel, with the slot errors of its disc, and their prediction."""

    __slots__ = (
        "coasting_noise",
        "covariance",
        "disc",
        "driven_noise",
        "edges_since_rest",
        "elapsed",
        "gain",
        "is_driven",
        "is_dry",
        "is_free_wheeling",
        "is_typical",
        "kind",
        "log_lag",
        "log_likelihood",
        "offset",
        "phase",
        "priors",
        "speed",
        "z",
        "z_shift",
    )

    def __init__(self, priors: Priors, slots: int, kind: MotorKind = MotorKind.LINEAR) -> None:
        """`slots` of the disc; `priors` in rad/s."""
        self.kind = kind
        is_typical = kind <= MotorKind.FREE_WHEELING
        self.is_typical = is_typical
        """whether its priors are those of a usual motor"""
        self.is_free_wheeling = kind % 2 == 1
        """whether no current brakes it between the driver's pulses"""
        if not is_typical:
            priors = priors.widened()
        self.priors = priors = priors.in_pitches(slots)
        # Factors of the variance of the speed's noise, learnt from the innovations.
        self.driven_noise = self.coasting_noise = self._usual_noise
        self.coasting_noise = max(self.coasting_noise, self._coasting_noise_min)
        self.is_driven = True  # in the last prediction
        self.elapsed = 0.0  # s, since the last measurement
        self.edges_since_rest = 0  # or since its drive has reversed
        self.disc = SlotErrors(slots, priors.slot, priors.open_share, priors.open_share_error)
        self.z = self.phase = 0.5
        self.speed = self.offset = self.z_shift = 0.0
        self.gain = 1.0
        # Braked by dry friction when coasting; None: not yet known.
        self.is_dry: bool | None = True if self.is_free_wheeling else None
        self.log_likelihood = 0.0  # of all measurements
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
    def _coasting_noise_min(self) -> float:
        """Least factor of the noise's variance while nothing drives it."""
        return SHORTED_NOISE if self.is_free_wheeling and self.priors.brakes else 1.0

    @property
    def travel(self) -> float:
        """Pitches since the start."""
        return self.z - self.phase

    @property
    def variance(self) -> float:
        """Variance of `travel`, pitches2."""
        covariance = self.covariance
        return covariance[Z_Z] - 2.0 * covariance[Z_PHASE] + covariance[PHASE_PHASE]

    @property
    def speed_variance(self) -> float:
        """(pitches/s)2"""
        return self.covariance[DIAGONAL[1]]

    @property
    def finds_faults(self) -> bool:
        """Whether its predictions are good enough to tell a missing edge from a slower wheel: those
        with wide priors are where the board reports when the edges came."""
        priors = self.priors
        return (self.is_typical or priors.has_edge_times) and priors.change_cost != inf

    @property
    def is_suspect(self) -> bool:
        """Whether its counts have contradicted the predictions for some time.

        Frames whose own time is uncertain do so without any fault. The times of edges show a fault
        as such.
        """
        priors = self.priors
        has_exact_time = priors.frame_time < FRAME_TIME_MAX and not priors.has_edge_times
        return has_exact_time and self.driven_noise > SUSPECT_NOISE * self._usual_noise

    @property
    def _usual_noise(self) -> float:
        """Factor of the noise's variance that is expected of its kind."""
        return 1.0 if self.is_typical else WIDE_NOISE_RATIO**2

    def largest_speed(self, sds: float) -> float:
        """Speed (pitches/s) that the wheel may have: `sds` standard deviations more than
        estimated."""
        return abs(self.speed) + sds * sqrt(self.speed_variance + self.priors.creep**2)

    @property
    def coasting_travel(self) -> float:
        """Pitches, without sign, that the wheel travels until it rests when it is released now.

        Of a motor whose friction is not yet known, the mean of both.
        """
        speed, travel = abs(self.speed), 0.0
        low = self.gain * self.priors.shorted_speed
        if low and self.is_free_wheeling and speed > low:
            lag, _ = self._response(1.0)
            settled, time = self._shorted_motion(speed)
            if time == inf:
                return lag * speed
            travel = lag * (speed - low) - settled * time
            speed = low
        lag, factor = self._response(self._idle_duty)
        if self.is_dry is False:
            return lag * speed
        settled = factor * max(self.gain * self.priors.friction - self.offset, 0.0)
        dry = lag * speed
        if settled > 0.0:
            dry -= lag * settled * log(1.0 + speed / settled)
        return travel + (dry if self.is_dry else 0.5 * (dry + lag * speed))

    def change_cost(self, excess: float) -> float:
        """Minus the log probability of a sudden change of the motion, where z seems to be `excess`
        pitches too far. A wheel that starts may be held for longer than predicted."""
        cost = self.priors.change_cost
        is_late = excess * self.speed > 0.0
        if is_late and self.edges_since_rest < STARTING_EDGES and cost != inf:
            return min(cost, STARTING_CHANGE_COST)
        return cost

    def is_rolling(self, creeps: float) -> bool:
        """True when the speed exceeds `creeps` times the creep speed."""
        return abs(self.speed) > creeps * self.priors.creep

    def edge_variance(self, is_forward: bool) -> float:
        """Predicted variance of z at an edge."""
        priors = self.priors
        share_variance = 0.0 if is_forward else priors.open_share * priors.open_share
        return self.covariance[Z_Z] + priors.slot * priors.slot + share_variance

    def copy(self) -> Self:
        """An independent copy, for a new hypothesis."""
        duplicate = copy(self)
        duplicate.disc = self.disc.copy()
        return duplicate

    def shift(self, pitches: float) -> None:
        """Move the origin of z to another slot or edge."""
        self.z += pitches
        self.phase += pitches
        self.z_shift += pitches

    @property
    def start(self) -> float:
        """The phase relative to the original origin of z."""
        return self.phase - self.z_shift

    def predict(self, span: float, drive: float, duty: float) -> None:
        """Predict `span` seconds ahead with `drive` (pitches/s) at a `duty` of -1 to 1."""
        sign = (drive > 0.0) - (drive < 0.0)
        if self.gain * drive * sign + self.offset <= 0.0:  # friction never drives the wheel
            drive, sign = 0.0, 0
        if self.speed == 0.0 and not drive:
            self.elapsed += span
            return
        speed = self.speed
        if not duty and self.priors.shorted_speed and self.is_free_wheeling:
            span -= self._brake_shorted(span)
            if span <= 0.0:
                return
        if self.is_free_wheeling:
            response = self._response(abs(duty) or self._idle_duty)
        else:
            response = exp(self.log_lag), 1.0
        if self.is_dry and speed * sign <= 0.0 and speed != 0.0:
            self._brake(span, drive, duty, response)
            return
        self._move(span, drive, sign, response, is_driven=drive != 0.0)
        if not drive and abs(self.speed) < self.priors.creep:
            self._stop(response[0])

    def _response(self, duty: float) -> tuple[float, float]:
        """Lag (s) at a duty, and factor of the speed at which the motor settles."""
        lag = exp(self.log_lag)
        if not self.is_free_wheeling:
            return lag, 1.0
        damping = VISCOUS + duty
        return lag * LAG_DUTY / damping, (1.0 + VISCOUS) / damping

    @property
    def _idle_duty(self) -> float:
        """The duty whose damping a released motor has: 1 when its driver shorts it."""
        return 1.0 if self.priors.brakes and not self.priors.shorted_speed else 0.0

    def _brake_shorted(self, span: float) -> float:
        """Predict a motor that its driver shorts, while its voltage exceeds that of the driver's
        transistors; below, it coasts. Returns the part of `span` (s) in which it does."""
        direction = 1 if self.speed > 0.0 else -1
        speed = direction * self.speed
        if speed <= self.gain * self.priors.shorted_speed:
            return 0.0
        time = min(self._shorted_motion(speed)[1], span)
        drive = -direction * (self.priors.friction - self._bridge_drive)
        self._move(time, drive, direction, self._response(1.0), is_driven=False)
        return time

    def _shorted_motion(self, speed: float) -> tuple[float, float]:
        """Of a shorted motor: minus the speed (pitches/s) at which it would settle, and the time
        (s) in which it falls from `speed` to that below which it coasts."""
        lag, factor = self._response(1.0)
        settled = factor * (self.gain * (self.priors.friction - self._bridge_drive) - self.offset)
        low = self.gain * self.priors.shorted_speed
        if low + settled <= 0.0:  # no friction at all
            return settled, inf
        return settled, lag * log((speed + settled) / (low + settled))

    @property
    def _bridge_drive(self) -> float:
        """Drive (pitches/s) to which the voltage of the driver's transistors is equal."""
        return self.priors.shorted_speed / (1.0 + VISCOUS)

    def _brake(self, span: float, drive: float, duty: float, response: tuple[float, float]) -> None:
        """Predict a wheel that dry friction brakes, and what follows after it has stopped."""
        direction = 1 if self.speed > 0.0 else -1
        # A drive against the motion adds to the friction, whose sign is then included twice. A duty
        # within the dead band does not overcome the friction, but takes its part off it.
        share = 1.0 if drive else self._dead_band_share(-direction * duty)
        braking = abs(drive) + self.priors.friction * (1.0 + share)
        lag, factor = response
        settled = factor * (self.gain * braking - self.offset)
        if settled > 0.0:
            stop_time = lag * log(1.0 + abs(self.speed) / settled)
        else:
            stop_time, braking, direction = inf, 0.0, 0
        drive_against = -direction * braking
        self._move(min(stop_time, span), drive_against, direction, response, is_driven=False)
        if stop_time < span:
            self._stop(lag if factor == 1.0 else self._stopping_time(lag, settled))
            if drive:
                self.predict(span - stop_time, drive, duty)

    def _dead_band_share(self, duty: float) -> float:
        """`duty` over that which overcomes the friction; 1 at most, without its sign."""
        dead_band = self.priors.dead_band
        return min(max(duty / dead_band, -1.0), 1.0) if dead_band else 0.0

    def _stopping_time(self, lag: float, settled: float) -> float:
        """Half of the time (s) in which friction alone takes the uncertain part of the speed."""
        return 0.5 * lag * sqrt(self.speed_variance) / settled

    def _move(
        self, span: float, drive: float, sign: int, response: tuple[float, float], is_driven: bool
    ) -> None:
        """Predict an exponential approach to `factor` times gain * drive + offset * sign."""
        speed = self.speed
        lag, factor = response
        settling, direction = factor * drive, factor * sign
        decay = exp(-span / lag)
        rise = 1.0 - decay
        speed_travel = lag * rise
        drive_travel = span - speed_travel
        excess = speed - self.gain * settling - self.offset * direction
        self.z += speed * span - excess * drive_travel
        self.speed = speed - excess * rise
        lag_decay = span * decay
        rows = (
            speed_travel,
            settling * drive_travel,
            direction * drive_travel,
            excess * (speed_travel - lag_decay),
            decay,
            settling * rise,
            direction * rise,
            excess * lag_decay / lag,
        )
        priors = self.priors
        self.is_driven = is_driven
        self.elapsed += span
        model_noise = priors.model_noise
        if not is_driven:
            speed_noise = self.coasting_noise * model_noise * model_noise * span
            self._predict_covariance(rows, speed_noise, span, 0.0, 0.0)
            return
        noise_factor, offset_drift, gain_drift = (
            self.driven_noise,
            priors.offset_drift,
            priors.gain_drift,
        )
        self._predict_covariance(
            rows,
            noise_factor * model_noise * model_noise * span,
            span,
            noise_factor * offset_drift * offset_drift * span,
            gain_drift * gain_drift * span,
        )

    def _stop(self, time: float) -> None:
        """Friction stops the wheel; the distance until then is as uncertain as the speed was, over
        `time` seconds."""
        self.speed = 0.0
        self.edges_since_rest = 0
        covariance = list(self.covariance)
        covariance[Z_Z] += self.speed_variance * time * time
        for entry in SPEED_ENTRIES:
            covariance[entry] = 0.0
        self.covariance = tuple(covariance)
        self.disc.wheel_stopped()

    def _predict_covariance(
        self,
        rows: TransitionRows,
        noise: float,
        span: float,
        offset_noise: float,
        gain_noise: float,
    ) -> None:
        """P = F P F' + Q, where `rows` are the rows of z and speed in F.

        Written out for speed: it runs at least once per wheel and frame.
        """
        if not self.disc.is_fixed:
            self.disc.predict(rows)
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
        gg += gain_noise
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

    def release(self, drive: float, elapsed: float) -> None:
        """Let a wheel turn that was taken for standing under `drive` (pitches/s) and has passed an
        edge within `elapsed` seconds: the drive exceeds its friction."""
        settled = self.gain * abs(drive) + self.offset
        rise = max(RELEASED_RATIO * self.gain * abs(drive) - settled, 0.0)
        self.offset += rise
        elapsed = max(elapsed, ELAPSED_MIN)  # frames that have queued up have one time
        covariance = list(self.covariance)
        covariance[DIAGONAL[1]] += 1.0 / (elapsed * elapsed)
        covariance[DIAGONAL[3]] += rise * rise
        self.covariance = tuple(covariance)

    def command_changed(self, change: float) -> None:
        """Account for the uncertain time at which the drive changes by `change` (pitches/s)."""
        if self.priors.command_time:
            z_variance = self.covariance[Z_Z] + (change * self.priors.command_time) ** 2
            self.covariance = (z_variance, *self.covariance[1:])

    def drive_reversed(self) -> None:
        """Account for what the offset does not say of the other direction, where it is unusual, and
        that the wheel will start anew."""
        self.edges_since_rest = 0
        excess = abs(self.offset) - UNUSUAL_OFFSET_SDS * self.priors.offset
        if excess > 0.0:
            covariance = list(self.covariance)
            covariance[DIAGONAL[3]] += excess * excess
            self.covariance = tuple(covariance)
