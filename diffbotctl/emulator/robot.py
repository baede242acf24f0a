"""From a robot file to the settings of its board, and to its emulated self."""

from __future__ import annotations

from random import Random

from diffbotctl.config.configuration import Configuration
from diffbotctl.config.robot import Robot, SideSection
from diffbotctl.drivers.simulated_robot import board_kind, gains, plant_parameters, world
from diffbotctl.emulator.emulated_robot import EmulatedBoard, EmulatedRobotDriver
from diffbotctl.emulator.process import Emulator
from diffbotctl.errors import ConfigurationError, Problem
from diffbotctl.links import diffbot_settings
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.diffbot_settings import BoardSettings
from diffbotctl.plant.simulated_robot import SimulatedRobot
from diffbotctl.plant.world import World
from diffbotctl.time import SECOND

FIRMWARE_FOR = "mega2560"
FIRST_ANALOG = 54  # number of pin A0 on a Mega 2560


def board_settings(robot: Robot) -> BoardSettings:
    """What our firmware must know of this robot.

    Raises ConfigurationError for a board that it does not run on.
    """
    if robot.board.type != FIRMWARE_FOR:
        cause = f"there is no firmware of ours for the board {robot.board.type} yet"
        fix = f"take a Mega 2560 (board: {{type: {FIRMWARE_FOR}}}), or simulate: --port sim"
        raise ConfigurationError(Problem("E-BOARD-KIND", "board.type", cause, fix))
    drive, left = robot.drive, gains(robot.drive.left)
    battery = robot.battery
    name, sensor = next(iter(robot.sensors.items()), ("range", None))
    return BoardSettings(
        _side(drive.left),
        _side(drive.right),
        slots=drive.left.encoder.slots,
        edge=drive.left.encoder.edge,
        glitch=round(drive.left.encoder.glitch * SECOND),
        deadman=round(robot.board.deadman * SECOND),
        telemetry=round(robot.board.telemetry),
        edge_times=robot.board.edge_times,
        proportional=left.proportional,
        integral=left.integral,
        brake=drive.left.motor.idle == "brake",
        range_channel=None if sensor is None else number(sensor.pin) - FIRST_ANALOG,
        range_name=name,
        battery_channel=None if battery.pin is None else number(battery.pin) - FIRST_ANALOG,
        battery_divider=battery.divider or 1.0,
        battery_low=battery.low,
        button=None if robot.board.stop_button is None else number(robot.board.stop_button),
        uart=robot.link.uart,
        baud=robot.link.baud,
    )


def _side(side: SideSection) -> diffbot_settings.WheelSettings:
    loop = gains(side)
    motor = side.motor
    return diffbot_settings.WheelSettings(
        enable=number(motor.enable),
        in1=number(motor.in1),
        in2=number(motor.in2),
        encoder=number(side.encoder.pin),
        reversed=motor.reversed,
        start=loop.static,
        gain=loop.slope,
    )


def number(pin: object) -> int:
    """The board's number of a pin that is written `5` or `A0`."""
    text = str(pin)
    return FIRST_ANALOG + int(text[1:]) if text.startswith("A") else int(text)


def emulated_robot_driver(configuration: Configuration, seed: int) -> EmulatedRobotDriver:
    """The robot of a configuration with the real firmware on an emulated board.

    Raises EmulatorError naming the Debian packages when the emulator cannot be built.
    """
    robot, nominal = configuration.robot, configuration.nominal
    assert robot is not None and nominal is not None
    board = emulated_board(nominal, seed, world(configuration))
    return EmulatedRobotDriver(board, DiffbotHost(board_settings(robot)))


def emulated_board(nominal: Robot, seed: int, around: World | None = None) -> EmulatedBoard:
    """A board wired to its plant as the robot file states. Raises EmulatorError."""
    plant = SimulatedRobot(
        board_kind(nominal), plant_parameters(nominal), nominal.simulation, Random(seed), around
    )
    settings = board_settings(nominal)
    motors = [(side.enable, side.in1, side.in2) for side in (settings.left, settings.right)]
    return EmulatedBoard(plant, settings, Emulator(motors))
