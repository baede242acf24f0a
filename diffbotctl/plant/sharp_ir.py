"""The Sharp GP2Y0A41SK0F infrared sensor: its curve with the fold-back, sampled every 16.5 ms.

The typical curve of the data sheet (ED-05G101, white paper) is interpolated point by point. It is
independent of the formula with which the host converts volts to metres.
"""

from __future__ import annotations

from bisect import bisect_right
from math import inf
from random import Random

MEASURING_PERIOD = 16_500_000  # ns; typical value of the data sheet
SETTLING_TIME = 5_000_000  # ns, at most, from a measurement to its output

# (distance in m, volts). Below 3 cm the light misses the detector: the voltage falls again.
CURVE = (
    (0.000, 0.03),
    (0.005, 1.38),
    (0.010, 1.85),
    (0.020, 2.22),
    (0.025, 2.73),
    (0.030, 3.03),
    (0.035, 2.99),
    (0.040, 2.72),
    (0.050, 2.34),
    (0.060, 2.02),
    (0.070, 1.765),
    (0.080, 1.56),
    (0.090, 1.395),
    (0.100, 1.265),
    (0.120, 1.06),
    (0.140, 0.928),
    (0.160, 0.813),
    (0.180, 0.735),
    (0.200, 0.656),
    (0.250, 0.525),
    (0.300, 0.430),
    (0.350, 0.370),
    (0.400, 0.312),
)
RESIDUAL_VOLTS = 0.06  # the output amplifier does not reach ground when nothing reflects
_DISTANCES = tuple(distance for distance, _ in CURVE)
# Beyond the data sheet's last point: V = TAIL / (d + TAIL_SHIFT) - DARK
TAIL, TAIL_SHIFT, DARK = 0.1502, 0.0135, 0.048  # V m, m, V; fit to the points up to 40 cm


def volts(distance: float) -> float:
    """Voltage at `distance` (m) of white paper; RESIDUAL_VOLTS where nothing reflects."""
    if distance >= _DISTANCES[-1]:
        if distance == inf:
            return RESIDUAL_VOLTS
        return max(RESIDUAL_VOLTS, TAIL / (distance + TAIL_SHIFT) - DARK)
    after = bisect_right(_DISTANCES, max(distance, 0.0))
    (near, high), (far, low) = CURVE[after - 1], CURVE[after]
    return high + (low - high) * (max(distance, 0.0) - near) / (far - near)


class Sharp:
    """One sensor. Its output is constant between two measurements.

    The caller passes the true distance to `measure` at `due`, and reads `output` at any time.
    """

    def __init__(self, noise: float, offset: float, rng: Random, now: int = 0) -> None:
        """`noise`: standard deviation in V of each reading; `offset` in V."""
        self._noise, self._offset, self._rng = noise, offset, rng
        self.due = now + rng.randrange(MEASURING_PERIOD)
        self._valid = self.due + SETTLING_TIME
        self._before = self._after = RESIDUAL_VOLTS

    def measure(self, distance: float) -> None:
        """Do the measurement that is due, at `distance` (m)."""
        self._before, self._after = self._after, volts(distance)
        self._valid = self.due + SETTLING_TIME
        self.due += MEASURING_PERIOD

    def catch_up(self, now: int) -> None:
        """Skip the measurements that were due before `now`: there was nothing to measure."""
        if self.due < now:
            self.due += -(-(now - self.due) // MEASURING_PERIOD) * MEASURING_PERIOD

    def output(self, now: int) -> float:
        """Voltage at the pin at `now`, with noise; never below 0."""
        volts = self._after if now >= self._valid else self._before
        return max(0.0, volts + self._offset + self._rng.gauss(0.0, self._noise))
