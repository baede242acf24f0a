"""The components of a simulated robot, drawn at random about what the robot file states."""

from __future__ import annotations

from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import Simulation
from diffbotctl.model.laser_scanners import LASER_SCANNERS
from diffbotctl.plant.chassis import Chassis, draw_chassis
from diffbotctl.plant.range_sensors import RangeSensors, draw_scanners, draw_sharps
from diffbotctl.plant.robot_parameters import PlantParameters
from diffbotctl.plant.wheel import EncoderDisc, MotorModel, WheelModel, draw_disc, draw_motors
from diffbotctl.plant.world import World

OVERHEAD_CAMERA = "overhead_camera"


class PlantComponents(NamedTuple):
    """Motors, discs and wheels stand left and right."""

    motors: tuple[MotorModel, MotorModel]
    discs: tuple[EncoderDisc, ...]
    chassis: Chassis
    wheels: tuple[WheelModel, ...]
    sensors: RangeSensors
    cameras: tuple[str, ...]  # names of the overhead cameras
    board_rng: Random


def draw_components(
    parameters: PlantParameters, simulation: Simulation, rng: Random, world: World
) -> PlantComponents:
    """Draw all components. The order of the draws defines which robot a seed stands for."""
    motors = draw_motors(parameters.rated, simulation.motor, rng)
    slots = simulation.encoder.slots or parameters.disc or parameters.slots
    discs = tuple(draw_disc(simulation.encoder, slots, rng) for _ in range(2))
    chassis = draw_chassis(parameters, simulation, rng)
    sharps = [
        sensor
        for sensor in parameters.sensors
        if sensor.kind not in (*LASER_SCANNERS, OVERHEAD_CAMERA)
    ]
    drawn_sharps = draw_sharps(sharps, simulation.sensors, rng)
    # Own generators for what happens often: the draws of one wheel do not change the other's.
    seeds = [rng.getrandbits(64) for _ in range(3)]
    wheels = tuple(
        WheelModel(motor, disc, Random(seed), falling=parameters.falling)
        for motor, disc, seed in zip(motors, discs, seeds, strict=False)
    )
    scanners = draw_scanners(parameters.sensors, simulation.sensors, rng)
    cameras = (sensor.name for sensor in parameters.sensors if sensor.kind == OVERHEAD_CAMERA)
    return PlantComponents(
        motors,
        discs,
        chassis,
        wheels,
        RangeSensors(world, drawn_sharps, scanners),
        tuple(cameras),
        Random(seeds[2]),
    )
