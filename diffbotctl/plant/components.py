"""The components of a simulated robot, drawn at random about what the robot file states."""

from collections.abc import Sequence
from math import pi, prod
from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import Disturbance, Simulation
from diffbotctl.geometry.distance_sensors import is_analog
from diffbotctl.plant.battery import RecoveringBattery, SimulatedBattery
from diffbotctl.plant.chassis import Chassis, draw_chassis
from diffbotctl.plant.drive_train import DriveTrain, ExponentialDrive
from diffbotctl.plant.encoder_disc import EncoderDisc, draw_disc, draw_eccentric
from diffbotctl.plant.quadrature import edges_of_two
from diffbotctl.plant.range_sensors import RangeSensors, draw_echoes, draw_scanners, draw_sharps
from diffbotctl.plant.robot_parameters import PlantParameters
from diffbotctl.plant.torque_drive import TorqueDrive, TorqueWheel, draw_setup, draw_torque_motor
from diffbotctl.plant.wheel import MotorModel, WheelModel, draw_motors
from diffbotctl.plant.world import World
from diffbotctl.time import NEVER, SECOND

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


class DisturbanceState(NamedTuple):
    """What acts at one time: factor of the supply, drag of the wheels (duty), shares of their turns
    by which they slide, encoders that lose every second slot or all, the stop button."""

    supply: float
    left_drag: float
    right_drag: float
    left_slide: float
    right_slide: float
    left_halved: bool
    right_halved: bool
    left_silent: bool
    right_silent: bool
    button: bool


class DisturbanceSchedule:
    """The disturbances of one run. `due`: when the next one begins or ends, ns."""

    def __init__(self, disturbances: Sequence[Disturbance]) -> None:
        self._spans = [
            (
                round(disturbance.start * SECOND),
                NEVER if disturbance.end is None else round(disturbance.end * SECOND),
                disturbance,
            )
            for disturbance in disturbances
        ]
        self.due = self._next(-1)

    def update(self, now: int) -> DisturbanceState:
        """What acts from `now` on."""
        active = [disturbance for start, end, disturbance in self._spans if start <= now < end]
        self.due = self._next(now)
        return DisturbanceState(
            prod(disturbance.supply for disturbance in active),
            sum(disturbance.left_drag for disturbance in active),
            sum(disturbance.right_drag for disturbance in active),
            max((disturbance.left_slide for disturbance in active), default=0.0),
            max((disturbance.right_slide for disturbance in active), default=0.0),
            any(disturbance.left_halved for disturbance in active),
            any(disturbance.right_halved for disturbance in active),
            any(disturbance.left_silent for disturbance in active),
            any(disturbance.right_silent for disturbance in active),
            any(disturbance.button for disturbance in active),
        )

    def _next(self, now: int) -> int:
        """The first beginning or end after `now`."""
        times = [time for start, end, _ in self._spans for time in (start, end)]
        return min((time for time in times if time > now), default=NEVER)
