"""The Sharp GP2Y0A41SK0F infrared sensor: its curve, its fold-back and its staircase.

The typical curve of the datasheet (ED-05G101, white paper) is read point by point; nothing here is
the formula with which the host turns volts back into metres.
"""

from __future__ import annotations

from bisect import bisect_right
from math import inf
from random import Random

CYCLE = 16_500_000  # ns; typical measuring period of the datasheet
SETTLE = 5_000_000  # ns; the output is valid at most this long after each measurement

# distance in m, volts; below 3 cm the light misses the detector and the voltage falls again
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
RESIDUE = 0.06  # V; the output amplifier does not reach ground when nothing reflects
_PLACES = tuple(place for place, _ in CURVE)
# Beyond the datasheet's last point the light dies with distance: V = TAIL / (d + TAIL_SHIFT) - DARK
TAIL, TAIL_SHIFT, DARK = 0.1502, 0.0135, 0.048  # V m, m, V; fit to the points up to 40 cm


def volts(distance: float) -> float:
    """Voltage at `distance` (m) of white paper; the residue where nothing reflects."""
    if distance >= _PLACES[-1]:
        if distance == inf:
            return RESIDUE
        return max(RESIDUE, TAIL / (distance + TAIL_SHIFT) - DARK)
    after = bisect_right(_PLACES, max(distance, 0.0))
    (near, high), (far, low) = CURVE[after - 1], CURVE[after]
    return high + (low - high) * (max(distance, 0.0) - near) / (far - near)


class Sharp:
    """One sensor. Measures each 16.5 ms; between measurements its output stands still.

    The caller asks `due`, hands the true distance to `measure` then, and reads `output` any time.
    """

    def __init__(self, noise: float, offset: float, chance: Random, now: int = 0) -> None:
        """`noise`: standard deviation in V of each reading; `offset` in V."""
        self._noise, self._offset, self._chance = noise, offset, chance
        self.due = now + chance.randrange(CYCLE)
        self._valid = self.due + SETTLE
        self._before = self._after = RESIDUE

    def measure(self, distance: float) -> None:
        """Take the measurement that is due, at `distance` (m)."""
        self._before, self._after = self._after, volts(distance)
        self._valid = self.due + SETTLE
        self.due += CYCLE

    def catch_up(self, now: int) -> None:
        """Leave out what was due before `now`: there was nothing to see."""
        if self.due < now:
            self.due += -(-(now - self.due) // CYCLE) * CYCLE

    def output(self, now: int) -> float:
        """Voltage at the pin at `now`, with noise; never below 0."""
        held = self._after if now >= self._valid else self._before
        return max(0.0, held + self._offset + self._chance.gauss(0.0, self._noise))
