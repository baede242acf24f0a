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

from math import copysign, exp, log1p, sqrt
from typing import NamedTuple

from diffbotctl.config.motor_drivers import BridgeFigures

HEAT_TIME_S = 10.0
# Over the temperature rise at the continuous current: 150 K / 125 K, 130 K / 125 K.
SHUTDOWN_RISE, RESTART_RISE = 1.2, 1.04


# The pulses of our firmware, and the current of usual motors in them: the inductance of a small
# motor over its resistance is 0.2 to 1 ms.
PULSE_S = 1 / 977
ELECTRICAL_TIME_S = 0.0004


class BridgeModel(NamedTuple):
    """Both bridges of a driver, as the plant needs them.

    Currents are over the stall current, voltages over that of the motors at the full battery,
    speeds over the no-load speed, positive in the direction of the duty.
    """

    threshold: float = 0.0  # share of the full battery's voltage
    stall_load: float | None = None  # stall current over the continuous one; None: unknown
    shuts_down: bool = False  # when it is too hot

    def supply(self, share: float) -> float:
        """Share of the full voltage at the motor, for that of the battery."""
        return max(share - self.threshold, 0.0) / (1.0 - self.threshold)

    def mean_current(self, duty: float, supply: float, speed: float, shorted: float) -> float:
        """Mean of the current over a pulse, which is the torque over the stall torque.

        `duty` is not negative; `shorted`: share of the pulse for which the bridge shorts the motor.
        While it is open no current flows. Shorted through a threshold, the current of the pulse
        flows until it has died, and then that of a motor above the threshold, which brakes; the
        next pulse begins against it, through the diodes.
        """
        driven = duty * (supply - speed)
        if not self.threshold or not shorted:
            return driven - shorted * speed
        drop = self.threshold / (1.0 - self.threshold)
        against, falling = drop + speed, 0.0
        if driven > 0.0:
            peak = (supply - speed) * (1.0 - exp(-duty * PULSE_S / ELECTRICAL_TIME_S))
            falling = shorted
            if against > 0.0:
                falling = min(shorted, ELECTRICAL_TIME_S / PULSE_S * log1p(peak / against))
        braking = copysign(max(abs(speed) - drop, 0.0), speed)
        mean = driven - falling * against - (shorted - falling) * braking
        if driven > 0.0 and braking > 0.0:
            back = braking * (1.0 - exp(-(shorted - falling) * PULSE_S / ELECTRICAL_TIME_S))
            reverse = ELECTRICAL_TIME_S / PULSE_S * log1p(back / (supply + 2.0 * drop - speed))
            mean += 2.0 * drop * min(reverse, duty)
        return mean

    def current(self, duty: float, supply: float, speed: float, shorted: float) -> float:
        """Root mean square of the current; see `mean_current`."""
        closed = abs(duty) + shorted
        if not closed:
            return 0.0
        mean = abs(duty) * supply / closed - speed
        return sqrt(closed) * (abs(mean) if shorted else max(mean, 0.0))


# What a robot without a driver has: the motors follow the duty.
IDEAL_BRIDGE = BridgeModel()


def bridge_model(figures: BridgeFigures, full: float, stall_current: float | None) -> BridgeModel:
    """The bridges at a battery of `full` V, for motors with this stall current (A)."""
    return BridgeModel(
        figures.threshold_share(full),
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
