"""The gyro of the simulated robot: what a real part measures of the true turn.

On a flat floor the robot turns about the vertical alone. A gyro that is mounted askew measures the
cosine of its tilt of that, which is one more error of its scale. An axis across measures the sine.
"""

from __future__ import annotations

from math import cos, exp, sin, sqrt
from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import GyroTruth
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_faults import GYRO_CAUSES
from diffbotctl.links.diffbot_telemetry import TURN
from diffbotctl.plant.chassis import Chassis
from diffbotctl.time import SECOND

WARM_TIME_S = 60.0  # time constant of its warming
# A fault is noticed by the board after this time, which it takes to exclude a disturbance.
NOTICED_AFTER = {"silent": 100_000_000, "bus_held": 100_000_000, "stuck": 260_000_000}
FAULT_FLAGS = {
    "silent": frames.FLAG_GYRO_SILENT,
    "bus_held": frames.FLAG_GYRO_BUS,
    "stuck": frames.FLAG_GYRO_STUCK,
}


class _Motion(NamedTuple):
    """Where the gyro was last asked: ns, rad, m, m/s."""

    time: int
    heading: float
    travel: float
    speed: float


class SimulatedGyro:
    """Integrates what the gyro measures; `angle` is the sum so far, in rad."""

    def __init__(self, truth: GyroTruth, rng: Random) -> None:
        self.scale = (1.0 + rng.uniform(-1.0, 1.0) * truth.scale_spread) * cos(truth.tilt)
        self.bias = rng.uniform(-1.0, 1.0) * truth.bias
        self.angle = 0.0
        self._drift = rng.choice((-1.0, 1.0)) * truth.drift
        self._truth, self._rng = truth, rng
        self._across_rng = Random("across")
        self._motion = _Motion(0, 0.0, 0.0, 0.0)
        self._rate = 0.0  # rad/s, the last one that was measured
        self._fault_start = round(truth.fault_start * SECOND)

    def measure(self, now: int, chassis: Chassis, projection: int = 1) -> float:
        """Add what it measures until `now` (ns); its mean rate since the last call, in rad/s.

        `projection` of the axis that is read: 1 along the one that points up, -1 against it, 0
        across.
        """
        before = self._motion
        span = (now - before.time) / SECOND
        if span <= 0.0:
            return self._rate
        turned, moved = chassis.heading - before.heading, chassis.travel - before.travel
        speed = moved / span
        self._motion = _Motion(now, chassis.heading, chassis.travel, speed)
        if not self._is_faulty(now):
            share = projection * self.scale if projection else sin(self._truth.tilt)
            aside, ahead = speed * turned / span, (speed - before.speed) / span
            self._rate = (
                share * turned / span
                + self.bias
                + self._drift * (1.0 - exp(-now / SECOND / WARM_TIME_S))
                + self._truth.acceleration_effect * (aside + ahead)
                + self._truth.noise / sqrt(span) * self._rng.gauss(0.0, 1.0)
            )
        self.angle += self._rate * span
        return self._rate

    def across(self, span: float) -> float:
        """A reading of an axis across that is level: its noise over `span` s, in rad/s."""
        if self._is_faulty(self._motion.time):
            return 0.0
        return self._truth.noise / sqrt(span) * self._across_rng.gauss(0.0, 1.0)

    def put_down(self, heading: float) -> None:
        """The robot was put elsewhere, at `heading` (rad), without turning."""
        self._motion = self._motion._replace(heading=heading)

    def reported(self) -> float:
        """The sum as the board reports it, in rad."""
        return self.angle // TURN * TURN

    def fault(self, now: int) -> str:
        """Why the board does not trust it; empty when it does."""
        kind = self._truth.fault
        if kind == "plain" or now < self._noticed_at():
            return ""
        return GYRO_CAUSES[FAULT_FLAGS[kind]]

    @property
    def fault_kind(self) -> str:
        """The fault that has begun, or `plain`."""
        return self._truth.fault if self._is_faulty(self._motion.time) else "plain"

    def _noticed_at(self) -> int:
        """A gyro that never worked was never trusted."""
        delay = NOTICED_AFTER[self._truth.fault] if self._fault_start else 0
        return self._fault_start + delay

    def _is_faulty(self, now: int) -> bool:
        return self._truth.fault != "plain" and now >= self._fault_start
