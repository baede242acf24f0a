"""Extended Kalman filter of one wheel and its motor: what edges and bounds tell of its motion.

`predicted_wheel.py` has the state and its prediction. Lengths are pitches, times seconds.

A wheel that meets an obstacle or a seam, or whose battery gives way, does not move as its motor
model predicts. Such a change is a second explanation of an innovation, with a normal distribution
as wide as the innovation itself (a maximum likelihood estimate of its variance).
"""

from __future__ import annotations

from math import erf, exp, inf, log, pi, sqrt

from diffbotctl.estimation.predicted_wheel import (
    DIAGONAL,
    ELAPSED_MIN,
    UNIFORM_VARIANCE,
    Z_SPEED,
    Z_Z,
    PredictedWheel,
)
from diffbotctl.estimation.slot_errors import MeasurementRow, SlotErrors


def is_outlier(ratio: float, cost: float) -> bool:
    """Whether a sudden change of the motion explains an innovation better than its variance.

    `ratio`: of the square of the innovation to the variance. `cost`: minus the log probability of
    such a change.
    """
    return 0.5 * ratio > cost and ratio - log(1.0 + ratio) > 2.0 * cost + 1.0


def robust_log_likelihood(innovation: float, variance: float, cost: float) -> float:
    """Log density of `innovation`, which may also be caused by a sudden change of the motion."""
    ratio = innovation * innovation / variance
    if not is_outlier(ratio, cost):
        return -0.5 * (ratio + log(2.0 * pi * variance))
    return -0.5 - cost - 0.5 * log(2.0 * pi * variance * (1.0 + ratio))


def normal_density(square: float, variance: float) -> float:
    """Of a normal distribution at the root of `square`, times the root of 2 pi."""
    return exp(-0.5 * square / variance) / sqrt(variance)


def normal_cdf(value: float) -> float:
    """Cumulative distribution function of the standard normal distribution."""
    return 0.5 * (1.0 + erf(value * 0.7071067811865476))


def truncated_normal(below: float, above: float, mass: float) -> tuple[float, float]:
    """Mean and variance of a standard normal truncated to (below, above).

    `mass`: probability of that interval.
    """
    at_below = exp(-0.5 * below * below) / sqrt(2.0 * pi)
    at_above = exp(-0.5 * above * above) / sqrt(2.0 * pi)
    mean = (at_below - at_above) / mass
    variance = 1.0 + (below * at_below - above * at_above) / mass - mean * mean
    return mean, max(variance, 0.0)


SURE_SDS = 2.6  # standard deviations; 99 % of a normal distribution are within
PROBABILITY_MIN = 1e-6  # below it a bound is applied as a measurement of its nearer end
# Probability that z is within bounds that it has reached by a sudden change.
LOG_CHANGED_WITHIN = log(0.25)
EDGE_SD_MIN = 0.004  # pitches; play of the light barrier
EDGE_TIME_SD = 50e-6  # s
# Adaptation of the noise by each edge: gain, squared normalised innovation at which it stays as it
# is, the largest one taken into account, and limit of the factor of the noise's variance.
NOISE_GAIN, NOISE_RATIO, NOISE_RATIO_MAX, NOISE_FACTOR_MAX = 0.2, 1.3, 9.0, 400.0
LOG_LAG_MIN, LOG_LAG_MAX = log(0.001), log(2.0)  # of lags that a robot file may state
WITHIN_RATIO = 1.0  # taken for z within its bounds, which shows little of the noise


class WheelKalman(PredictedWheel):
    """The motion of one wheel, updated by its edges."""

    __slots__ = ()

    def update_edge(self, place: float, slot: int, is_forward: bool) -> None:
        """Kalman update by an edge of `slot`, nominally at z = `place`."""
        disc = self.disc
        disc.start_learning()
        if not disc.is_fixed:
            self._update_edge_and_slots(disc, place, slot, is_forward)
            return
        error, variance = disc.edge_estimate(slot, is_forward)
        innovation = place + error - self.z
        innovation_variance = self._add_log_likelihood(innovation, self.covariance[Z_Z] + variance)
        row = self._z_row()
        self._update(row, innovation / innovation_variance, 1.0 / innovation_variance)

    def _update_edge_and_slots(
        self, disc: SlotErrors, place: float, slot: int, is_forward: bool
    ) -> None:
        """Kalman update by an edge while learning: z minus the slot error is measured."""
        disc.propagate()
        index = disc.index(slot, is_forward)
        error_row, error_slot_row = disc.rows(index)
        slot_row = [z - error for z, error in zip(disc.row(0), error_slot_row, strict=True)]
        z_variance = self.covariance[Z_Z] - error_row[0]
        # The edges seen backward are not learnt slot by slot.
        noise = disc.slot_variance
        if is_forward:
            noise = EDGE_SD_MIN * EDGE_SD_MIN + (self.speed * EDGE_TIME_SD) ** 2
        innovation = place + disc.errors[index] - self.z
        variance = self._add_log_likelihood(innovation, z_variance - slot_row[index] + noise)
        row = tuple([z - error for z, error in zip(self._z_row(), error_row, strict=True)])
        scaled_innovation = innovation / variance
        self._update(row, scaled_innovation, 1.0 / variance)
        disc.update(row, slot_row, scaled_innovation, 1.0 / variance)
        if index == 0:
            disc.stop_learning_if_known()

    def probability_within(self, low: float, high: float) -> float:
        """Predicted probability that z lies between `low` and `high`."""
        sd = self._bounds_sd()
        return normal_cdf((high - self.z) / sd) - normal_cdf((low - self.z) / sd)

    def is_near(self, place: float, sds: float) -> bool:
        """Whether z may be at `place`: within `sds` standard deviations."""
        return abs(place - self.z) < sds * self._bounds_sd()

    def is_surely_nearer(self, pitches: float) -> bool:
        """Whether z is nearer than `pitches` to its estimate with a probability above 0.99."""
        return pitches > 0.0 and pitches * pitches > SURE_SDS * SURE_SDS * self._bounds_variance()

    def bounds_log_likelihood(self, low: float, high: float) -> float:
        """Log probability that z lies between `low` and `high`, also after a sudden change of the
        motion."""
        return self._robust_log(self.probability_within(low, high), low, high)

    def _robust_log(self, probability: float, low: float, high: float) -> float:
        """Log of the `probability` that z lies between `low` and `high`, or of that of a sudden
        change of the motion."""
        likelihood = log(probability if probability > PROBABILITY_MIN else PROBABILITY_MIN)
        changed = LOG_CHANGED_WITHIN - self.change_cost(self.z - 0.5 * (low + high))
        return likelihood if likelihood >= changed else changed

    def update_bounds(self, low: float, high: float) -> None:
        """Update by the knowledge that z lies between `low` and `high`."""
        sd = self._bounds_sd()
        below, above = (low - self.z) / sd, (high - self.z) / sd
        probability = normal_cdf(above) - normal_cdf(below)
        self.log_likelihood += self._robust_log(probability, low, high)
        distance = max(low - self.z, self.z - high, 0.0)
        ratio = distance * distance / (sd * sd)
        cost = self.priors.change_cost
        if cost != inf:
            self._adapt_noise(max(ratio, WITHIN_RATIO))
            if is_outlier(ratio, cost):
                self._add_sudden_change(distance)
                sd = self._bounds_sd()
                below, above = (low - self.z) / sd, (high - self.z) / sd
                probability = normal_cdf(above) - normal_cdf(below)
        variance = sd * sd
        if probability < PROBABILITY_MIN:
            nearer = low if below > 0.0 else high
            self._update_z((nearer - self.z) / variance, 1.0 / variance)
            return
        mean, remaining_variance = truncated_normal(below, above, probability)
        self._update_z(mean / sd, (1.0 - remaining_variance) / variance)

    def update_uniform(self, low: float, high: float) -> None:
        """Update by the knowledge that z is anywhere from `low` to `high`."""
        variance = self.covariance[Z_Z]
        remaining = (high - low) ** 2 * UNIFORM_VARIANCE
        innovation = 0.5 * (low + high) - self.z
        self._update_z(innovation / variance, (1.0 - remaining / variance) / variance)

    def _bounds_sd(self) -> float:
        """Predicted standard deviation of z relative to an edge, at the time of a frame."""
        return sqrt(self._bounds_variance())

    def _bounds_variance(self) -> float:
        priors = self.priors
        variance = self.covariance[Z_Z] + priors.slot * priors.slot
        if priors.frame_time:
            variance += (self.speed * priors.frame_time) ** 2
        return variance

    def _add_log_likelihood(self, innovation: float, variance: float) -> float:
        """Add that of an edge. Returns the variance to update with, larger for an outlier.

        A wheel that is suddenly braked, or whose battery fails, does not move as predicted: then
        its speed and offset are as uncertain as the innovation shows, and it carries no information
        about the other states.
        """
        cost = self.priors.change_cost
        self.log_likelihood += robust_log_likelihood(
            innovation, variance, self.change_cost(-innovation)
        )
        if cost == inf:
            return variance
        ratio = innovation * innovation / variance
        self._adapt_noise(ratio)
        if not is_outlier(ratio, cost):
            return variance
        self._add_sudden_change(innovation)
        return variance + innovation * innovation

    def _add_sudden_change(self, innovation: float) -> None:
        excess = innovation * innovation
        # The speed may have changed by the innovation in the time of one pitch, or in the time
        # since the last measurement where that is longer: with several edges in a frame. A wheel
        # that was taken for standing and has passed a whole pitch did so in that time.
        rate = 1.0 / max(self.elapsed, ELAPSED_MIN)
        if excess < 1.0 or abs(self.speed) > self.priors.creep:
            rate = min(rate, max(abs(self.speed), self.priors.creep))
        covariance = list(self.covariance)
        covariance[Z_Z] += excess
        covariance[Z_SPEED] += excess * rate
        covariance[DIAGONAL[1]] += excess * rate * rate
        covariance[DIAGONAL[3]] += excess * rate * rate
        self.covariance = tuple(covariance)

    def _adapt_noise(self, ratio: float) -> None:
        """Adapt the noise of the motor model to the squared `ratio` of an innovation to its
        standard deviation: without a systematic error its mean is 1."""
        change = exp(NOISE_GAIN * (min(ratio, NOISE_RATIO_MAX) - NOISE_RATIO))
        if self.is_driven:
            self.driven_noise = min(max(self.driven_noise * change, 1.0), NOISE_FACTOR_MAX)
        else:
            least = self._coasting_noise_min
            self.coasting_noise = min(max(self.coasting_noise * change, least), NOISE_FACTOR_MAX)

    def _update_z(self, scaled_innovation: float, inverse_variance: float) -> None:
        row, disc = self._z_row(), self.disc
        self._update(row, scaled_innovation, inverse_variance)
        if not disc.is_fixed:
            disc.propagate()
            disc.update(row, disc.row(0), scaled_innovation, inverse_variance)

    def _z_row(self) -> MeasurementRow:
        return self.covariance[:6]

    def _update(
        self, row: MeasurementRow, scaled_innovation: float, inverse_variance: float
    ) -> None:
        """Kalman update by a quantity whose covariance with the state is `row`.

        x += row * `scaled_innovation` (innovation divided by its variance),
        P -= row row' * `inverse_variance`. Written out for speed, as `_predict_covariance`.
        """
        self.elapsed = 0.0
        z, v, g, b, lag, f = row
        self.z += z * scaled_innovation
        self.speed += v * scaled_innovation
        self.gain += g * scaled_innovation
        self.offset += b * scaled_innovation
        self.log_lag = min(max(self.log_lag + lag * scaled_innovation, LOG_LAG_MIN), LOG_LAG_MAX)
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
