"""Rigs for each kind of robot: simulated, on an emulated board, or real behind a port."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from diffbotctl.calibrate.session import Keys, Make, RobotSession
from diffbotctl.calibrate.simulated_tools import SimulatedTruth
from diffbotctl.config.configuration import RobotFile
from diffbotctl.drivers.robot_link import board_settings, is_duty_board
from diffbotctl.drivers.serial_robot import open_serial_robot
from diffbotctl.drivers.simulated_robot import SimulatedRobotDriver
from diffbotctl.emulator.emulated_robot import EmulatedBoard, EmulatedRobotDriver, emulated_board
from diffbotctl.engine.clock import PacedClock, VirtualClock
from diffbotctl.engine.driver import RobotDriver
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.plant.robot_parameters import plant_parameters
from diffbotctl.plant.simulated_robot import SimulatedRobot, draw_robot
from diffbotctl.plant.world import World


def open_session(
    file: RobotFile,
    port: str,
    seed: int = 0,
    keys: Keys | None = None,
    tell: Callable[[str], None] = print,
    world: World | None = None,
) -> tuple[RobotSession, SimulatedTruth | None]:
    """The robot of `file` behind `port` (`sim`, `emulated` or a device), and its instruments.

    Simulated and emulated robots live in virtual time, as fast as it goes. Raises RunError when the
    port cannot be opened, EmulatorError when there is no emulator.
    """
    if port == "sim":
        plant = draw_robot(file.robot, file.nominal, seed, world)
        made = RobotSession(file, _simulated(plant), VirtualClock(), keys)
        return made, _truths(plant, made, seed)
    if port == "emulated":
        board = emulated_board(file.nominal, seed, world)
        made = RobotSession(file, _emulated(board), VirtualClock(), keys)
        return made, _truths(board.plant, made, seed)
    return RobotSession(file, _real(port, tell), PacedClock(exact=False), keys), None


def _truths(plant: SimulatedRobot, made: RobotSession, seed: int) -> SimulatedTruth:
    return SimulatedTruth(plant, made.listen, Random(f"instruments {seed}"))


def _simulated(plant: SimulatedRobot) -> Make:
    def make(file: RobotFile, before: RobotDriver | None, now: int) -> RobotDriver:
        if before is not None:
            plant.advance(now)
            plant.rewire(plant_parameters(file.robot, file.nominal))
        return SimulatedRobotDriver(plant, is_duty_board(file.robot))

    return make


def _emulated(board: EmulatedBoard) -> Make:
    def make(file: RobotFile, before: RobotDriver | None, now: int) -> RobotDriver:
        board.advance(now)
        board.received.clear()
        return EmulatedRobotDriver(board, DiffbotHost(board_settings(file.robot)))

    return make


def _real(device: str, tell: Callable[[str], None]) -> Make:
    def make(file: RobotFile, before: RobotDriver | None, now: int) -> RobotDriver:
        if before is not None:
            before.close()
        return open_serial_robot(file.robot, device, tell, now)

    return make
