"""The motor driver of the plant: what its bridges make of the battery's voltage, and their heat.

`rated` of a robot file is the speed with the driver in the path, so its resistance is part of the
motor's. What remains of a bipolar bridge is a threshold that does not shrink with the battery: of a
weaker battery the motors lose more than their share.

The chip heats with the square of the current. It is 125 K warmer than its surroundings at the
continuous current, which is what makes that current the limit (25 to 150 degrees); it switches both
motors off at 175 degrees and on again 20 K below (Toshiba TB6612FNG; TI states 150 to 180). Its
time constant is no figure of a data sheet but an estimate for a small package on its board.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import NamedTuple

from diffbotctl.config.motor_drivers import BridgeFigures

HEAT_TIME_S = 10.0
# Over the temperature rise at the continuous current: 150 K / 125 K, 130 K / 125 K.
SHUTDOWN_RISE, RESTART_RISE = 1.2, 1.04


class BridgeModel(NamedTuple):
    """Both bridges of a driver, as the plant needs them."""

    threshold: float = 0.0  # share of the full battery's voltage
    opens: bool = True  # between two pulses the motor's terminals are open
    stall_load: float | None = None  # stall current over the continuous one; None: unknown
    shuts_down: bool = False  # when it is too hot

    def supply(self, share: float) -> float:
        """Share of the full voltage at the motor, for that of the battery."""
        return max(share - self.threshold, 0.0) / (1.0 - self.threshold)

    def current(self, duty: float, supply: float, speed: float) -> float:
        """Root mean square of the current over the stall current.

        `speed`: over the no-load speed, positive in the direction of the duty.
        """
        size = abs(duty)
        if self.opens:
            return sqrt(size) * max(supply - speed, 0.0)
        return abs(size * supply - speed)


# What a robot without a driver has: the motors follow the duty.
IDEAL_BRIDGE = BridgeModel()


def bridge_model(figures: BridgeFigures, full: float, stall_current: float | None) -> BridgeModel:
    """The bridges at a battery of `full` V, for motors with this stall current (A)."""
    return BridgeModel(
        figures.threshold_share(full),
        figures.off_state == "open",
        None if stall_current is None else stall_current / figures.current,
        figures.has_thermal_shutdown,
    )


class BridgeHeat:
    """Temperature of the chip: its rise over that at the continuous current."""

    def __init__(self, model: BridgeModel) -> None:
        self._model = model
        self.rises = [0.0, 0.0]  # of either bridge
        self.is_off = False

    def update(self, currents: tuple[float, float], seconds: float) -> None:
        """Let time pass with these currents, over the stall current."""
        stall_load = self._model.stall_load
        if stall_load is None:
            return
        decay = exp(-seconds / HEAT_TIME_S)
        for number, current in enumerate(currents):
            target = 0.0 if self.is_off else (current * stall_load) ** 2
            self.rises[number] = target + (self.rises[number] - target) * decay
        hottest = max(self.rises)
        if hottest >= SHUTDOWN_RISE and self._model.shuts_down:
            self.is_off = True
        elif hottest <= RESTART_RISE:
            self.is_off = False
