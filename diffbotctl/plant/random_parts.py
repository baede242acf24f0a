"""The parts of a simulated robot, drawn by chance about what the robot file says of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from random import Random

from diffbotctl.plant.chassis import Chassis
from diffbotctl.plant.laser_scanner import PARTS, Scanner
from diffbotctl.plant.robot_parameters import MountedSensor, PlantParameters
from diffbotctl.plant.sharp_ir import Sharp
from diffbotctl.plant.simulation import SensorTruth, Simulation
from diffbotctl.plant.wheel import MotorModel


def draw_motors(
    machine: PlantParameters, simulation: Simulation, chance: Random
) -> tuple[MotorModel, MotorModel]:
    """The left and the right motor, of one make."""
    truth = simulation.motor
    lag = chance.uniform(*truth.lag)
    drawn = []
    for _ in range(2):
        start = chance.uniform(*truth.start_duty)
        drawn.append(
            MotorModel(
                speed=machine.rated * (1.0 + chance.uniform(-1.0, 1.0) * truth.gain_spread),
                lag=lag * (1.0 + chance.uniform(-1.0, 1.0) * truth.lag_spread),
                start=start,
                keep=start * truth.keep_share,
                ripple=truth.ripple,
                ripple_phase=chance.uniform(0.0, 2 * pi),
                coulomb=truth.coasting == "coulomb",
            )
        )
    return drawn[0], drawn[1]


def draw_body(machine: PlantParameters, simulation: Simulation, chance: Random) -> Chassis:
    """Wheels and axle, as they were really made."""
    truth = simulation.geometry
    track = machine.track * (1.0 + chance.uniform(-1.0, 1.0) * truth.track_spread)
    radii = [
        0.5 * diameter * (1.0 + chance.uniform(-1.0, 1.0) * truth.diameter_spread)
        for diameter in (machine.left_diameter, machine.right_diameter)
    ]
    return Chassis(track, radii[0], radii[1], simulation.slip, Random(chance.getrandbits(64)))


def draw_sensors(
    mountings: Sequence[MountedSensor], errors: Mapping[str, SensorTruth], chance: Random
) -> list[tuple[MountedSensor, Sharp]]:
    """A distance sensor for each of the mountings."""
    drawn = []
    for mounting in mountings:
        truth = errors.get(mounting.name) or SensorTruth()
        sensor = Sharp(truth.noise, truth.offset, Random(chance.getrandbits(64)))
        drawn.append((mounting, sensor))
    return drawn


def draw_scanners(
    mountings: Sequence[MountedSensor], errors: Mapping[str, SensorTruth], chance: Random
) -> list[tuple[MountedSensor, Scanner]]:
    """A laser scanner for each of the mountings that is one."""
    drawn = []
    for mounting in mountings:
        if mounting.kind in PARTS:
            truth = errors.get(mounting.name) or SensorTruth()
            seed = chance.getrandbits(64)
            drawn.append((mounting, Scanner(PARTS[mounting.kind], truth.spread, Random(seed))))
    return drawn
