"""A Sharp infrared sensor: its curve with the fold-back, sampled every 16.5 or 38.3 ms.

The typical curve of the data sheet (white paper) is interpolated point by point. It is independent
of the formula with which the host converts volts to metres.
"""

from __future__ import annotations

from random import Random

from diffbotctl.geometry.distance_sensors import (
    RESIDUAL_VOLTS,
    SHARPS,
    SharpFacts,
    paper_volts,
)
from diffbotctl.time import SECOND

GP2Y0A41 = SHARPS["sharp_gp2y0a41sk0f"]
CURVE = GP2Y0A41.points  # (distance in m, volts)
MEASURING_PERIOD = round(GP2Y0A41.period * SECOND)  # ns
SETTLING_TIME = 5_000_000  # ns, at most, from a measurement to its output


def volts(distance: float) -> float:
    """Voltage of a GP2Y0A41 at `distance` (m) of white paper."""
    return paper_volts(GP2Y0A41, distance)


class Sharp:
    """One sensor. Its output is constant between two measurements.

    The caller passes the true distance to `measure` at `due`, and reads `output` at any time.
    """

    def __init__(
        self,
        noise: float,
        offset: float,
        rng: Random,
        now: int = 0,
        facts: SharpFacts = GP2Y0A41,
    ) -> None:
        """`noise`: standard deviation in V of each reading; `offset` in V."""
        self._noise, self._offset, self._rng = noise, offset, rng
        self._facts, self._period = facts, round(facts.period * SECOND)
        self.due = now + rng.randrange(self._period)
        self._valid = self.due + SETTLING_TIME
        self._before = self._after = RESIDUAL_VOLTS

    def measure(self, distance: float) -> None:
        """Do the measurement that is due, at `distance` (m)."""
        self._before, self._after = self._after, paper_volts(self._facts, distance)
        self._valid = self.due + SETTLING_TIME
        self.due += self._period

    def catch_up(self, now: int) -> None:
        """Skip the measurements that were due before `now`: there was nothing to measure."""
        if self.due < now:
            self.due += -(-(now - self.due) // self._period) * self._period

    def volts_at(self, distance: float) -> float:
        """Voltage at `distance` (m), without noise."""
        return paper_volts(self._facts, distance) + self._offset

    def output(self, now: int) -> float:
        """Voltage at the pin at `now`, with noise; never below 0."""
        volts = self._after if now >= self._valid else self._before
        return max(0.0, volts + self._offset + self._rng.gauss(0.0, self._noise))
