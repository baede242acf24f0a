"""The motor supply of a simulated robot, and the board's measurement of it."""

from __future__ import annotations

from math import exp

from diffbotctl.config.simulation import BatteryTruth
from diffbotctl.plant.motor_bridge import IDEAL_BRIDGE, BridgeModel

ADC_REFERENCE = 5.0  # V; the board's analog inputs read up to this
ADC_STEPS = 1023
# A battery's drop under a constant load: at once, and with two time constants (s).
PROMPT_PART = 0.5
RECOVERIES = ((0.3, 0.6), (0.2, 25.0))
SAG_LOAD = 0.5  # mean current of both motors over their stall current at which `sag` is lost
SHARE_MIN = 0.05  # of the rest voltage that a battery keeps at any load


def read_analog(voltage: float) -> float:
    """A pin's voltage (V) as the board's converter rounds it."""
    steps = min(round(voltage / ADC_REFERENCE * ADC_STEPS), ADC_STEPS)
    return steps / ADC_STEPS * ADC_REFERENCE


class SimulatedBattery:
    """A battery whose voltage drops at once, in proportion to the duties of both motors.

    `supply` is a factor of its voltage, and `sag` the share that it loses at full duty; faults
    change both.
    """

    def __init__(
        self, truth: BatteryTruth, full: float, bridge: BridgeModel = IDEAL_BRIDGE
    ) -> None:
        """`full`: voltage (V) at which the motors reach their rated speed."""
        self._truth, self.full, self.supply, self.sag = truth, full, 1.0, truth.sag
        self._bridge = bridge
        self._volts = full if truth.volts is None else truth.volts
        self._rest_share = self._volts / full

    def voltage_ratio(self, left: float, right: float) -> float:
        """Voltage at the motors under the load of two duties, over that at a full battery."""
        return self._bridge.supply(self._share(left, right))

    def voltage(self, left: float, right: float) -> float:
        """Voltage (V) under the load of two duties."""
        return self.full * self._share(left, right)

    def _share(self, left: float, right: float) -> float:
        drop = self.sag * 0.5 * (abs(left) + abs(right))
        return self._rest_share * self.supply * (1.0 - drop)

    def pin_voltage(self, voltage: float, divider: float) -> float:
        """Voltage (V) at the board's pin, behind a divider that is nominally `divider`."""
        return voltage / (divider * (1.0 + self._truth.divider_error))


class RecoveringBattery(SimulatedBattery):
    """A battery that drops with the current of the motors, and recovers slowly after a load.

    `share`: its present voltage over the full voltage; `motor_share`: that at the motors.
    """

    def __init__(
        self, truth: BatteryTruth, full: float, bridge: BridgeModel = IDEAL_BRIDGE
    ) -> None:
        super().__init__(truth, full, bridge)
        self.share = self._rest_share
        self.motor_share = bridge.supply(self.share)
        self._drops = [0.0] * len(RECOVERIES)

    def voltage_ratio(self, left: float, right: float) -> float:
        """1: the motors themselves account for the supply."""
        return 1.0

    def voltage(self, left: float, right: float) -> float:
        """Voltage (V) at present."""
        return self.full * self.share

    def load(self, current: float, seconds: float) -> None:
        """Let time pass with the mean `current` of both motors over their stall current."""
        drop = self.sag * current / SAG_LOAD
        for number, (part, time) in enumerate(RECOVERIES):
            ratio = seconds / time
            decay = 1.0 - ratio if ratio < 0.01 else exp(-ratio)
            target = part * drop
            self._drops[number] = target + (self._drops[number] - target) * decay
        share = 1.0 - PROMPT_PART * drop - sum(self._drops, 0.0)
        self.share = self._rest_share * self.supply * max(share, SHARE_MIN)
        self.motor_share = self._bridge.supply(self.share)
