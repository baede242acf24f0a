"""The turn of a robot from its wheels and a gyro, each weighted by what is known of it.

Two measurements of one turn: that of the wheels is wrong by a share of the turn (track), a share of
the way (the ratio of the diameters) and what the wheels slip; that of the gyro by a share of the
turn (its scale) and by its bias. Their difference is the measurement of a Kalman filter with these
errors as states. It shows the errors of track and scale only together, so that they are one state,
of which each has the share of its prior variance. A scale that was not calibrated and is less well
known than the track is measured against it: the heading is then never worse than by the wheels
alone, whatever the true track is. Angles in rad, times in s.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians, sqrt

from diffbotctl.estimation.geometry_deviation import GeometryDeviation
from diffbotctl.estimation.gyro_turn import BIAS_WALK, TurnStep

SCALE, RATIO, BIAS, WHEELS, GYRO = 0, 1, 2, 3, 4
STATES = 5
# Standard deviations, and rad, of the difference of both turns, for wheels that slide: tyres scrub.
OUTLIER_SDS, OUTLIER_MIN = 5.0, radians(2.0)
# rad in a frame; while both turns differ by more, wheels that have begun to slide slide on.
SLIDING_TURN_MIN, SLIDING_RATIO = radians(0.3), 3.0


class TurnFusion:
    """Errors of both turns since `start`: of the scale against the track and of the ratio of the
    diameters, relative; of the bias (rad/s); and what both have added to the turns (rad)."""

    def __init__(
        self, geometry: Sequence[GeometryDeviation], scale_sd: float, is_calibrated: bool
    ) -> None:
        """`geometry`: the independent errors of track and diameters; `scale_sd`: of the gyro."""
        self.by_wheels = self.path = self.by_gyro = 0.0  # rad, ways over the track, rad
        self.errors = [0.0] * STATES
        self.covariance = [[0.0] * STATES for _ in range(STATES)]
        self.is_sliding = False
        track = sum(((0.5 * (e.left + e.right) - e.track) ** 2 for e in geometry), 0.0)
        scale = scale_sd * scale_sd
        self.wheels_are_reference = not is_calibrated and track < scale
        """whether turns are right by the wheels, but for the errors of their geometry"""
        if self.wheels_are_reference:
            track = 0.0
        total = track + scale
        self.scale_share = scale / total if total else 0.0
        """of the gyro's scale, in the error of both"""
        self.hidden_variance = self.scale_share * track
        """of the scale, when that error is known exactly"""
        ratio = sum(((e.right - e.left) ** 2 for e in geometry), 0.0)
        for state, variance in ((SCALE, total), (RATIO, ratio)):
            self.covariance[state][state] = variance

    @property
    def turn(self) -> float:
        """Since the start: that of the gyro, whose scale and bias the wheels have corrected. The
        wheels' own also has the errors of their places within a slot."""
        return self.by_gyro * (1.0 - self.scale_share * self.errors[SCALE]) - self.errors[GYRO]

    @property
    def scale_sd(self) -> float:
        """Standard deviation of `turn` by the scale, which the geometry has corrected; with the
        sign of the turn."""
        shown = self.scale_share * self.scale_share * max(self.covariance[SCALE][SCALE], 0.0)
        return self.by_gyro * sqrt(self.hidden_variance + shown)

    @property
    def variance(self) -> float:
        """Of `turn`."""
        row = (self.scale_share * self.by_gyro, 0.0, 0.0, 0.0, 1.0)
        return self._variance(row) + self.hidden_variance * self.by_gyro * self.by_gyro

    def start(self, bias_variance: float, wheels_variance: float = 0.0) -> None:
        """Measure turns from here, where the bias is known with this variance, and the wheels' turn
        with that: the turn is known to be 0. What is known of the constants stays."""
        self.by_wheels = self.path = self.by_gyro = 0.0
        for state, variance in ((BIAS, bias_variance), (WHEELS, wheels_variance), (GYRO, 0.0)):
            self._set(state, variance)

    def add(self, by_wheels: float, path: float, step: TurnStep, wheels_variance: float) -> None:
        """Both turned: the wheels by this angle on a `path` (ways over the track), with the
        variance of their slip."""
        self.by_wheels += by_wheels
        self.path += path
        self.by_gyro += step.angle
        span, rows = step.seconds, self.covariance
        if span:
            self.errors[GYRO] += span * self.errors[BIAS]
            rows[GYRO] = [a + span * b for a, b in zip(rows[GYRO], rows[BIAS], strict=True)]
            for row in rows:
                row[GYRO] += span * row[BIAS]
            rows[BIAS][BIAS] += BIAS_WALK * span
            rows[GYRO][GYRO] += step.variance
        rows[WHEELS][WHEELS] += wheels_variance
        if self.is_sliding:
            difference = by_wheels - step.angle
            self.is_sliding = abs(difference) > SLIDING_TURN_MIN
            rows[WHEELS][WHEELS] += (SLIDING_RATIO * difference) ** 2

    def compare(self, variance: float, weight: float) -> float:
        """Take the difference of both turns, with the variance of the wheels' places, of which this
        frame is worth `weight` independent ones. Returns by what the wheels have turned too far,
        where they slide; otherwise 0."""
        row = (-self.by_gyro, self.path, 0.0, 1.0, -1.0)
        innovation = self.by_wheels - self.by_gyro - _product(row, self.errors)
        known = self._variance(row)
        slid = 0.0
        limit = max(OUTLIER_MIN, OUTLIER_SDS * sqrt(known + variance))
        if self.is_sliding or abs(innovation) > limit:
            slid, self.is_sliding, weight = innovation, True, 1.0
            self.covariance[WHEELS][WHEELS] += slid * slid
            known += slid * slid
        self._update(row, innovation, known + variance / weight)
        return slid

    def bias_measured(self, error: float, variance: float) -> None:
        """The robot stands, and the bias was wrong by `error` (rad/s), known with this variance."""
        row = (0.0, 0.0, 1.0, 0.0, 0.0)
        total = self.covariance[BIAS][BIAS] + variance
        if total > 0.0:
            self._update(row, error - self.errors[BIAS], total)
        self._set(BIAS, variance)

    def _set(self, state: int, variance: float) -> None:
        """Let an error be unknown anew, independent of all others."""
        self.errors[state] = 0.0
        for row in self.covariance:
            row[state] = 0.0
        self.covariance[state] = [0.0] * STATES
        self.covariance[state][state] = variance

    def _variance(self, row: Sequence[float]) -> float:
        variance = 0.0
        for factor, covariances in zip(row, self.covariance, strict=True):
            if factor:
                variance += factor * _product(row, covariances)
        return variance

    def _update(self, row: Sequence[float], innovation: float, variance: float) -> None:
        """Kalman update by a scalar with the measurement matrix `row`."""
        rows = self.covariance
        gains = [_product(row, each) for each in rows]
        for i, gain in enumerate(gains):
            share = gain / variance
            self.errors[i] += share * innovation
            rows[i] = [a - share * b for a, b in zip(rows[i], gains, strict=True)]


def _product(a: Sequence[float], b: Sequence[float]) -> float:
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)
