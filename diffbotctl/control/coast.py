"""Adaptive estimate of how far released wheels travel."""

from __future__ import annotations

from typing import NamedTuple

COAST_SD = 0.25  # s; of the coast time before the first release: lags are up to 0.4 s
# s2/m; of its growth with the speed before the first release. Dry friction of 1 m/s2 makes it 0.5.
COAST_GROWTH_SD = 0.5
# Standard deviation of the coast time that odometry reports: relative, and s.
REPORTED_SD_RATIO, REPORTED_SD_MIN = 0.3, 0.1
COAST_DRIFT = 0.012  # s; change of the coast time from one release to the next
COAST_NOISE = 0.01  # s; of the coast time that one release shows
POSE_NOISE = 0.002  # m; of the distance that one release shows
COAST_SPEED_MIN = 0.005  # m/s; below it the innovation is mostly error of the pose
COAST_RATIO_MIN = 0.4  # least coast time, relative to the motors' lag
COAST_TIME_MAX = 0.6  # s


class Coast(NamedTuple):
    """Estimate of the coast time: released wheels travel their speed times it further.

    With motors that brake by their current it is their lag at any speed; with dry friction it grows
    with the speed.
    """

    time: float  # s, of slow wheels
    release_speed: float = 0.0
    """m/s towards the end of the leg, at the last release; 0 after it was used for an update"""
    variance: float = COAST_SD * COAST_SD  # s2; of `time`
    growth: float = 0.0  # s2/m; of the coast time with the speed; no friction makes it shrink
    growth_variance: float = COAST_GROWTH_SD * COAST_GROWTH_SD  # s4/m2
    covariance: float = 0.0  # s3/m; of `time` and `growth`
    release_time: float = 0.0  # s; the coast time that the last release was planned with

    def at(self, speed: float) -> float:
        """The coast time (s) of wheels released at `speed` (m/s)."""
        return self.time + self.growth * abs(speed)

    def expected(self, speed: float, reported: float) -> float:
        """The coast time (s) to plan a release at `speed` (m/s) with; odometry's is `reported`.

        It is the mean of the learnt and the reported time, weighted by their variances. A shorter
        reported time does not count: the friction of the motor model stops a slow wheel at
        once, before a real motor has lost its current.
        """
        learnt = self.at(speed)
        if reported <= learnt:
            return learnt
        variance = (
            self.variance
            + 2.0 * self.covariance * abs(speed)
            + self.growth_variance * speed * speed
        )
        reported_variance = max(REPORTED_SD_RATIO * reported, REPORTED_SD_MIN) ** 2
        return learnt + (reported - learnt) * variance / (variance + reported_variance)

    def learn(self, remaining: float, lag: float) -> Coast:
        """Kalman update by the `remaining` distance (m) of the leg at rest. `lag` of the motors in
        s."""
        speed = self.release_speed
        noise = COAST_NOISE * COAST_NOISE + (POSE_NOISE / speed) ** 2
        time_row = self.variance + self.covariance * speed
        growth_row = self.covariance + self.growth_variance * speed
        variance = time_row + growth_row * speed + noise
        innovation = (self.release_time - remaining / speed - self.at(speed)) / variance
        time = self.time + time_row * innovation
        growth = self.growth + growth_row * innovation
        lowest, highest = COAST_RATIO_MIN * lag, max(COAST_TIME_MAX, 2.0 * lag)
        time = min(max(time, lowest), highest)
        return self._replace(
            time=time,
            growth=min(max(growth, 0.0), (highest - time) / speed),
            release_speed=0.0,
            variance=self.variance - time_row * time_row / variance + COAST_DRIFT * COAST_DRIFT,
            growth_variance=self.growth_variance - growth_row * growth_row / variance,
            covariance=self.covariance - time_row * growth_row / variance,
        )
