"""The true values of a simulated robot, beside those that a calibration found."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from math import isnan, nan, pi
from typing import NamedTuple

from diffbotctl.blocks.range_sensor import distance_at
from diffbotctl.calibrate.result import (
    GYRO_SCALE,
    LEFT_DIAMETER,
    RIGHT_DIAMETER,
    SLIP,
    TRACK,
    Finding,
    FindingValue,
)
from diffbotctl.config.robot import SIDES
from diffbotctl.config.robot_tree import field
from diffbotctl.plant.simulated_robot import SimulatedRobot
from diffbotctl.plant.torque_drive import TorqueDrive

LINE_DUTIES, STEP_DUTY = (0.3, 0.9), 0.55  # of `calibrate motors`: of its line, and amid its steps
BISECTIONS, DIFFERENCE = 50, 1e-4
CURVE_DISTANCES_M = (0.05, 0.10, 0.20, 0.30)


class ComparedValue(NamedTuple):
    """One calibrated value of a simulated robot, in SI."""

    field: str
    unit: str
    found: float
    sd: float | None  # standard deviation; None if there is none
    true: float

    @property
    def deviation(self) -> float | None:
        """Error in standard deviations; None if the value has none."""
        return None if not self.sd else (self.found - self.true) / self.sd


def compare_findings(findings: Iterable[Finding], plant: SimulatedRobot) -> Iterator[ComparedValue]:
    """The numbers among the findings whose true value is defined, in their order."""
    truths = true_values(plant)
    values: dict[str, FindingValue] = {}
    for finding in findings:
        values[finding.field] = finding.value
        if finding.field not in truths or not isinstance(finding.value, int | float):
            continue
        declaration = field(finding.field)
        unit = "" if declaration is None else declaration.unit
        true = truths[finding.field]
        yield ComparedValue(finding.field, unit, float(finding.value), finding.sd, true)
    yield from _compare_curves(values, plant)


def _compare_curves(
    values: Mapping[str, FindingValue], plant: SimulatedRobot
) -> Iterator[ComparedValue]:
    """Of each curve of a Sharp sensor, the distances that it makes of the true voltages."""
    for name, true_volts in plant.sharp_curves().items():
        parameters = [values.get(f"sensors.{name}.curve.{parameter}") for parameter in "abc"]
        a, b, c = (value if isinstance(value, float) else nan for value in parameters)
        if isnan(a + b + c):
            continue
        for distance in CURVE_DISTANCES_M:
            found = distance_at(true_volts(distance), a, b, c)
            field = f"sensors.{name} at {100 * distance:.0f} cm"
            yield ComparedValue(field, "m", found, None, distance)


def true_values(plant: SimulatedRobot) -> dict[str, float]:
    """Actual values by field path, in SI.

    `rated` is the speed at full duty with the full battery voltage at the motor; `friction` the
    duty at which friction just stops a wheel that turns. Where the driver takes a voltage of its
    own and shorts the motors between two pulses, it is that of the line through the speeds at
    LINE_DUTIES: at less duty the speed falls steeply.
    """
    chassis = plant.chassis
    values = {
        LEFT_DIAMETER: 2 * chassis.left_radius,
        RIGHT_DIAMETER: 2 * chassis.right_radius,
        TRACK: chassis.track,
        SLIP: plant.simulation.slip,
        "link.command_delay": (plant.board.model.command_delay + plant.drive.dead_time) * 1e-9,
        "battery.divider": plant.parameters.built_divider
        * (1 + plant.simulation.battery.divider_error),
    }
    if plant.gyro is not None:
        values[GYRO_SCALE] = 1 / plant.gyro.scale
    for side, motor, disc in zip(SIDES, plant.motors, plant.discs, strict=True):
        edges = disc.edges[:: disc.channels]  # of channel A
        slots = len(edges) // 2
        pitch = 2 * pi / slots
        widths = [edges[2 * slot + 1] - edges[2 * slot] for slot in range(slots)]
        open_share = sum(widths) / slots / pitch
        values |= {
            f"drive.{side}.motor.rated": motor.speed,
            f"drive.{side}.motor.lag": motor.lag,
            f"drive.{side}.motor.friction": motor.keep,
            **_shorted_truth(plant, side),
            f"drive.{side}.encoder.slots": slots,
            f"drive.{side}.encoder.open_share": 1 - open_share
            if plant.parameters.falling
            else open_share,
        }
    return values


def _shorted_truth(plant: SimulatedRobot, side: str) -> dict[str, float]:
    """Friction and lag of a motor that is shorted between its pulses, by its torque;
    empty where the plant has no torques, or the driver opens there."""
    drive = plant.drive
    if not isinstance(drive, TorqueDrive) or not plant.parameters.shorted_between:
        return {}
    motor, bridge = drive.wheels[SIDES.index(side)].motor, drive.setup.bridge

    def torque(duty: float, speed: float) -> float:
        return bridge.mean_current(duty, 1.0, speed, 1.0 - duty) - motor.viscous * speed

    def settled(duty: float) -> float:
        return _root(lambda speed: motor.sliding - torque(duty, speed))

    low, high = LINE_DUTIES
    slow, fast = settled(low), settled(high)
    speed = settled(STEP_DUTY)
    change = torque(STEP_DUTY, speed - DIFFERENCE) - torque(STEP_DUTY, speed + DIFFERENCE)
    path = f"drive.{side}.motor"
    return {
        f"{path}.friction": low - slow * (high - low) / (fast - slow),
        f"{path}.lag": motor.speed / motor.acceleration * 2 * DIFFERENCE / change,
    }


def _root(increasing: Callable[[float], float]) -> float:
    """Where a function crosses 0, between 0 and 1."""
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if increasing(middle) < 0.0 else (low, middle)
    return low
