"""The true values of a simulated robot, beside those that a calibration found."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import pi
from typing import NamedTuple

from diffbotctl.calibrate.result import (
    GYRO_SCALE,
    LEFT_DIAMETER,
    RIGHT_DIAMETER,
    SLIP,
    TRACK,
    Finding,
)
from diffbotctl.config.robot import SIDES
from diffbotctl.config.robot_tree import field
from diffbotctl.plant.simulated_robot import SimulatedRobot


class ComparedValue(NamedTuple):
    """One calibrated value of a simulated robot, in SI."""

    field: str
    unit: str
    found: float
    sd: float | None
    """standard deviation; None if there is none"""
    true: float

    @property
    def deviation(self) -> float | None:
        """Error in standard deviations; None if the value has none."""
        return None if not self.sd else (self.found - self.true) / self.sd


def compare_findings(findings: Iterable[Finding], plant: SimulatedRobot) -> Iterator[ComparedValue]:
    """The numbers among the findings whose true value is defined, in their order."""
    truths = true_values(plant)
    for finding in findings:
        if finding.field not in truths or not isinstance(finding.value, int | float):
            continue
        declaration = field(finding.field)
        unit = "" if declaration is None else declaration.unit
        true = truths[finding.field]
        yield ComparedValue(finding.field, unit, float(finding.value), finding.sd, true)


def true_values(plant: SimulatedRobot) -> dict[str, float]:
    """Actual values by field path, in SI.

    `rated` is the speed at full duty with the full battery voltage at the motor; `friction` the
    duty at which friction just stops a wheel that turns. So is `loop.static` where the speed is
    linear in the duty.
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
            f"drive.{side}.encoder.slots": slots,
            f"drive.{side}.encoder.open_share": 1 - open_share
            if plant.parameters.falling
            else open_share,
        }
    return values
