"""The components of a simulated robot, drawn at random about what the robot file states."""

from math import pi
from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import Simulation
from diffbotctl.geometry.distance_sensors import is_analog
from diffbotctl.plant.battery import RecoveringBattery, SimulatedBattery
from diffbotctl.plant.chassis import Chassis, draw_chassis
from diffbotctl.plant.drive_train import DriveTrain, ExponentialDrive
from diffbotctl.plant.encoder_disc import EncoderDisc, draw_disc, draw_eccentric
from diffbotctl.plant.own_plant import OwnChassis, OwnDrive, plant_robot
from diffbotctl.plant.quadrature import edges_of_two
from diffbotctl.plant.range_sensors import RangeSensors, draw_echoes, draw_scanners, draw_sharps
from diffbotctl.plant.robot_parameters import PlantParameters
from diffbotctl.plant.torque_drive import TorqueDrive, TorqueWheel, draw_setup, draw_torque_motor
from diffbotctl.plant.wheel import MotorModel, WheelModel, draw_motors
from diffbotctl.plant.world import World

OVERHEAD_CAMERA = "overhead_camera"


class PlantComponents(NamedTuple):
    """Motors, discs and wheels stand left and right."""

    motors: tuple[MotorModel, MotorModel]
    discs: tuple[EncoderDisc, ...]
    chassis: Chassis
    drive: DriveTrain
    battery: SimulatedBattery
    sensors: RangeSensors
    cameras: tuple[str, ...]  # names of the overhead cameras
    board_rng: Random


def draw_components(
    parameters: PlantParameters, simulation: Simulation, rng: Random, world: World
) -> PlantComponents:
    """Draw all components. The order of the draws defines which robot a seed stands for."""
    motors = draw_motors(parameters.rated, simulation.motor, rng)
    built = simulation.encoder.slots
    slots = (built, built) if built else parameters.disc or parameters.counts
    discs = tuple(draw_disc(simulation.encoder, count, rng) for count in slots)
    if parameters.encoder_channels == 2:
        discs = tuple(
            disc._replace(
                edges=edges_of_two(disc.edges, 2 * pi), channels=2, every_edge=parameters.every_edge
            )
            for disc in discs
        )
    chassis = draw_chassis(parameters, simulation, rng)
    sharps = [sensor for sensor in parameters.sensors if is_analog(sensor.kind)]
    drawn_sharps = draw_sharps(sharps, simulation.sensors, rng)
    # Own generators for what happens often: the draws of one wheel do not change the other's.
    seeds = [rng.getrandbits(64) for _ in range(3)]
    if simulation.equations == "torque":
        discs = tuple(
            draw_eccentric(disc, simulation.encoder.slot_spread, Random(seeds[0])) for disc in discs
        )
    battery, drive = _draw_drive(parameters, simulation, motors, discs, chassis, seeds)
    if simulation.plant is not None:
        own = OwnDrive(simulation.plant(plant_robot(parameters), seeds[0]), parameters.falling)
        drive, chassis = own, OwnChassis(chassis, own)
    scanners = draw_scanners(parameters.sensors, simulation.sensors, rng)
    echoes = draw_echoes(parameters.sensors, simulation.sensors, rng)
    cameras = (sensor.name for sensor in parameters.sensors if sensor.kind == OVERHEAD_CAMERA)
    return PlantComponents(
        motors,
        discs,
        chassis,
        drive,
        battery,
        RangeSensors(world, drawn_sharps, scanners, echoes),
        tuple(cameras),
        Random(seeds[2]),
    )


def _draw_drive(
    parameters: PlantParameters,
    simulation: Simulation,
    motors: tuple[MotorModel, MotorModel],
    discs: tuple[EncoderDisc, ...],
    chassis: Chassis,
    seeds: list[int],
) -> tuple[SimulatedBattery, DriveTrain]:
    """Battery and wheels, with the equations of `simulation`. `seeds`: left, right, both."""
    falling = parameters.falling
    if simulation.equations == "exponential":
        return SimulatedBattery(
            simulation.battery, parameters.full, parameters.bridge
        ), ExponentialDrive(
            tuple(
                WheelModel(motor, disc, Random(seed), falling=falling)
                for motor, disc, seed in zip(motors, discs, seeds, strict=False)
            )
        )
    battery = RecoveringBattery(simulation.battery, parameters.full, parameters.bridge)
    rng = Random(seeds[2] ^ 1)
    radii = (chassis.left_radius, chassis.right_radius)
    setup = draw_setup(radii, chassis.track, rng)._replace(bridge=parameters.bridge)
    left, right = (
        TorqueWheel(draw_torque_motor(motor, rng), disc, Random(seed), falling)
        for motor, disc, seed in zip(motors, discs, seeds, strict=False)
    )
    return battery, TorqueDrive((left, right), setup, battery)
