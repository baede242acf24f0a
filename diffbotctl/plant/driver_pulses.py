"""What a motor driver does over a pulse: from the levels of its inputs, by its truth table."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

from diffbotctl.config.motor_drivers import OffState
from diffbotctl.links.diffbot_frames import DriverCode


class InputLevels(NamedTuple):
    """Shares of a pulse for which the inputs of a driver are high, all from its begin on."""

    enable: float = 1.0  # also of a driver without it
    in1: float = 0.0
    in2: float | None = None  # None: in1 is the direction


class PulseShares(NamedTuple):
    """What a driver does over a pulse; for the rest of it the motor is open."""

    duty: float  # positive where in1 drives
    shorted: float


def pulse_shares(states: Mapping[str, OffState], levels: InputLevels) -> PulseShares:
    """Shares of a pulse, by the truth table of a driver."""
    duty = shorted = 0.0
    ends = sorted({each for each in (*levels, 1.0) if each is not None and each > 0.0})
    for begin, end in pairwise((0.0, *ends)):
        enabled, first = levels.enable > begin, levels.in1 > begin
        second = levels.in2 > begin if levels.in2 is not None else not first
        if not enabled and states["enable_low"] == "open":
            continue
        if first == second:
            shorted += (end - begin) * (states["both_high" if first else "both_low"] == "shorted")
        elif enabled:
            duty += (end - begin) * (first - second)
        else:
            shorted += end - begin
    return PulseShares(duty, shorted)


def firmware_levels(driver: DriverCode, duty: float, is_held: bool) -> InputLevels:
    """The levels that our firmware gives a driver's inputs for `duty`.

    `is_held`: it brakes at rest; see motors.c.
    """
    size, is_forward = abs(duty), duty > 0.0
    brakes = is_held and not duty
    match driver:
        case DriverCode.PULSED_INPUTS:
            if not duty and not is_held:
                return InputLevels(0.0, 0.0, 0.0)
            low = 1.0 - size
            return InputLevels(1.0, 1.0, low) if is_forward else InputLevels(1.0, low, 1.0)
        case DriverCode.TWO_PWM:
            first, second = (size, 0.0) if is_forward else (0.0, size)
            return InputLevels(1.0, 1.0, 1.0) if brakes else InputLevels(1.0, first, second)
        case DriverCode.ENABLE_DIRECTION:
            return InputLevels(size, float(is_forward))
        case DriverCode.ENABLE_IN1_IN2:
            if not duty:
                return InputLevels(float(brakes), float(brakes), float(brakes))
            return InputLevels(size, float(is_forward), float(not is_forward))
