"""The gyro of the simulated robot: what a real part measures of the true turn.

On a flat floor the robot turns about the vertical alone. A gyro that is mounted askew measures the
cosine of its tilt of that, which is one more error of its scale. An axis across measures the sine.
A hand can lift the robot at its front or at its left side: it turns about its axes across.
"""

from __future__ import annotations

from math import cos, exp, sin, sqrt
from random import Random
from typing import Literal, NamedTuple

from diffbotctl.config.simulation import GyroTruth
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_states import GYRO_CAUSES
from diffbotctl.links.diffbot_telemetry import TURN
from diffbotctl.plant.chassis import Chassis
from diffbotctl.plant.faults import ActiveFaults
from diffbotctl.plant.imu_mounting import UP, Direction
from diffbotctl.time import SECOND

GyroFault = Literal["plain", "silent", "bus_held", "stuck"]
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


class _Lift(NamedTuple):
    """A hand lifts the robot: ns, and the angles (rad) of its front and of its left side."""

    start: int
    end: int
    before: tuple[float, float]
    after: tuple[float, float]

    def at(self, now: int) -> tuple[float, float]:
        """The angles at `now`."""
        if now >= self.end:
            return self.after
        share = max(now - self.start, 0) / (self.end - self.start)
        front, left = (
            low + share * (high - low) for low, high in zip(self.before, self.after, strict=True)
        )
        return front, left


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
        self._lift = _Lift(0, 0, (0.0, 0.0), (0.0, 0.0))
        self._lifting = (0.0, 0.0)  # rad/s, mean since the measurement before the last one
        self._rate = 0.0  # rad/s, the last one that was measured
        self._fault: GyroFault = "plain"
        self._fault_start = 0
        self._fault_bias, self.is_upside_down = 0.0, False

    def set_faults(self, now: int, faults: ActiveFaults) -> None:
        """What is wrong from `now` (ns) on."""
        kinds: tuple[GyroFault, ...] = ("silent", "bus_held", "stuck")
        active: GyroFault = next((kind for kind in kinds if faults.has(f"imu_{kind}")), "plain")
        if active != self._fault:
            self._fault, self._fault_start = active, now
        self._fault_bias = sum(faults.sizes("imu_biased"))
        self.is_upside_down = faults.has("imu_upside_down")

    def lift(self, now: int, front: float, left: float, seconds: float) -> None:
        """From `now` (ns) on a hand lifts front and left side of the robot to angles (rad)."""
        self._lift = _Lift(now, now + round(seconds * SECOND), self._lift.at(now), (front, left))

    def measure(self, now: int, chassis: Chassis, direction: Direction = UP) -> float:
        """Add what it measures until `now` (ns); its mean rate since the last call, in rad/s.

        `direction` of the axis that is read.
        """
        before = self._motion
        span = (now - before.time) / SECOND
        if span <= 0.0:
            return self._rate
        turned, moved = chassis.heading - before.heading, chassis.travel - before.travel
        speed = moved / span
        lifts = zip(self._lift.at(now), self._lift.at(before.time), strict=True)
        front, left = ((after - earlier) / span for after, earlier in lifts)
        self._lifting = front, left
        self._motion = _Motion(now, chassis.heading, chassis.travel, speed)
        if not self._is_faulty(now):
            share = direction.up * self.scale if direction.up else sin(self._truth.tilt)
            share = -share if self.is_upside_down else share
            aside, ahead = speed * turned / span, (speed - before.speed) / span
            self._rate = (
                share * turned / span
                + self._lifted(direction)
                + self.bias
                + self._fault_bias
                + self._drift * (1.0 - exp(-now / SECOND / WARM_TIME_S))
                + self._truth.acceleration_effect * (aside + ahead)
                + self._truth.noise / sqrt(span) * self._rng.gauss(0.0, 1.0)
            )
        self.angle += self._rate * span
        return self._rate

    def across(self, span: float, direction: Direction) -> float:
        """A reading of an axis across that is level, over `span` s: its noise and what a hand does,
        in rad/s."""
        if self._is_faulty(self._motion.time):
            return 0.0
        noise = self._truth.noise / sqrt(span) * self._across_rng.gauss(0.0, 1.0)
        return self._lifted(direction) + noise

    def _lifted(self, direction: Direction) -> float:
        """The rate by hand: the left side goes up about the axis forward, the front against that to
        the left."""
        front, left = self._lifting
        return self.scale * (direction.forward * left - direction.left * front)

    def put_down(self, heading: float) -> None:
        """The robot was put elsewhere, at `heading` (rad), without turning."""
        self._motion = self._motion._replace(heading=heading)

    def reported(self) -> float:
        """The sum as the board reports it, in rad."""
        return self.angle // TURN * TURN

    def fault(self, now: int) -> str:
        """Why the board does not trust it; empty when it does."""
        if self._fault == "plain" or now < self._noticed_at():
            return ""
        return GYRO_CAUSES[FAULT_FLAGS[self._fault]]

    @property
    def fault_kind(self) -> GyroFault:
        """The fault that has begun, or `plain`."""
        return self._fault

    def _noticed_at(self) -> int:
        """A gyro that never worked was never trusted."""
        delay = NOTICED_AFTER[self._fault] if self._fault_start else 0
        return self._fault_start + delay

    def _is_faulty(self, now: int) -> bool:
        return self._fault != "plain" and now >= self._fault_start
