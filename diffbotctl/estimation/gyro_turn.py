"""Turn of the robot from the sum of a gyro's rate, with its bias measured at every standstill.

Radians and seconds.
"""

from __future__ import annotations

from math import radians, sqrt
from typing import NamedTuple

from diffbotctl.links.diffbot_frames import TURN_NANODEGREES

# Angle random walk, rad/sqrt(s): data sheets state 0.005 deg/s/sqrt(Hz), and up to twice that.
NOISE = radians(0.007)
RESOLUTION_SD = radians(TURN_NANODEGREES * 1e-9) / sqrt(12.0)  # of the sum in a frame
BIAS_MAX = radians(20.0)  # rad/s, zero-rate output of an MPU6050
# Variance of the bias, (rad/s)2 per s: as it warms up it drifts by 0.2 deg/s in one or two minutes.
BIAS_WALK = radians(0.1) ** 2 / 60.0
BIAS_SD_MAX = radians(0.006)  # rad/s; a worse one gives no better heading than wheels
WINDOW_MIN_S, WINDOW_MAX_S = 0.08, 2.0  # of the rate at rest
# Rates that differ by more from their mean are those of a robot that is moved by hand. A bias that
# differs by more from the expected one is that of wheels that creep on, unless it lasts.
# The first bias is not compared with an expected one: a hand that pushes the robot by less than an
# edge would be in it. A gyro at rest has a noise of 0.05 deg/s.
STEADY_RATE, FIRST_STEADY_RATE = radians(3.0), radians(0.5)
JUMP_SDS = 4.0


class TurnStep(NamedTuple):
    """Turn since the previous frame, rad; its noise, rad2; the time in which the bias acted."""

    angle: float
    variance: float
    seconds: float


class _Rest(NamedTuple):
    """Begin of a window at rest, and what was known of the bias then."""

    time: int
    turn: float
    bias: float
    variance: float


class GyroTurn:
    """The gyro of one run, from the sums in successive frames."""

    def __init__(self, scale: float) -> None:
        """`scale`: true turn divided by measured turn."""
        self.scale = scale
        self.bias = 0.0
        """rad/s, of the measured rate"""
        self.variance = BIAS_MAX * BIAS_MAX
        """of the bias"""
        self.is_zeroed = False
        """True when the bias has been known well enough for a heading"""
        self._time: int | None = None
        self._turn = 0.0
        self._rest: _Rest | None = None

    def restart(self) -> None:
        """The sum begins again, or was wrong up to now."""
        self._time = self._rest = None

    def update(self, time: int, turn: float, is_at_rest: bool) -> TurnStep | None:
        """Take the sum at `time` (ns); the step since the last one, None for the first."""
        if self._time is None:
            self._time, self._turn = time, turn
            return None
        if time <= self._time:  # frames that have queued up
            return TurnStep(0.0, 0.0, 0.0)
        span, change = (time - self._time) * 1e-9, turn - self._turn
        self._time, self._turn = time, turn
        if not is_at_rest:
            self._rest = None
        elif self._stands(time, turn, change / span):
            return TurnStep(0.0, 0.0, 0.0)
        self.variance += BIAS_WALK * span
        angle = self.scale * (change - self.bias * span)
        return TurnStep(angle, NOISE * NOISE * span, span)

    def _stands(self, time: int, turn: float, rate: float) -> bool:
        """Measure the bias; False when the robot is turned although its wheels stand."""
        is_turned = self.is_zeroed and abs(rate - self.bias) > STEADY_RATE
        rest = self._rest
        span = 0.0 if rest is None else (time - rest.time) * 1e-9
        if rest is None or span > WINDOW_MAX_S:
            self._rest = _Rest(time, turn, self.bias, self.variance + BIAS_WALK * span)
            return not is_turned
        if span < WINDOW_MIN_S:
            return not is_turned
        mean = (turn - rest.turn) / span
        if abs(rate - mean) > (STEADY_RATE if self.is_zeroed else FIRST_STEADY_RATE):
            self._rest = None
            return False
        error = 2.0 * RESOLUTION_SD * RESOLUTION_SD / (span * span) + NOISE * NOISE / span
        prior, innovation = rest.variance, mean - rest.bias
        if abs(innovation) > JUMP_SDS * sqrt(prior + error):
            if span < 0.9 * WINDOW_MAX_S:
                return False
            prior = BIAS_MAX * BIAS_MAX
        gain = prior / (prior + error)
        self.bias = rest.bias + gain * innovation
        self.variance = (1.0 - gain) * prior
        self.is_zeroed = self.is_zeroed or self.variance <= BIAS_SD_MAX * BIAS_SD_MAX
        return True
