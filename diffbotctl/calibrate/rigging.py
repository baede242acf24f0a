"""Rigs for each kind of robot: simulated, on an emulated board, or real behind a port."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from diffbotctl.calibrate.instruments import Truths
from diffbotctl.calibrate.rig import Keys, Rig
from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.emulated import Emulated
from diffbotctl.drivers.simulated import Simulated
from diffbotctl.engine.clock import PacedClock, VirtualClock
from diffbotctl.engine.driver import RobotDriver
from diffbotctl.links.diffbot import DiffbotHost
from diffbotctl.plant.robot import SimulatedRobot
from diffbotctl.plant.world import World
from diffbotctl.runs.emulation import emulated_board, settings_of
from diffbotctl.runs.real import serial_robot_of
from diffbotctl.runs.simulation import drawn, machine, takes_duty


def rig(
    file: RobotFile,
    port: str,
    seed: int = 0,
    keys: Keys | None = None,
    tell: Callable[[str], None] = print,
    world: World | None = None,
) -> tuple[Rig, Truths | None]:
    """The robot of `file` behind `port` (`sim`, `emulated` or a device), and its instruments.

    Simulated and emulated robots live in virtual time, as fast as it goes. Raises RunError when the
    port cannot be opened, EmulatorError when there is no emulator.
    """
    if port == "sim":
        plant = drawn(file.robot, file.nominal, seed, world)
        made = Rig(file, _simulated(plant), VirtualClock(), keys)
        return made, _truths(plant, made, seed)
    if port == "emulated":
        board = emulated_board(file.nominal, seed, world)
        made = Rig(file, lambda now, new: _emulated(now, new, board), VirtualClock(), keys)
        return made, _truths(board.plant, made, seed)
    return Rig(file, _real(port, tell), PacedClock(exact=False), keys), None


def _truths(plant: SimulatedRobot, made: Rig, seed: int) -> Truths:
    return Truths(plant, made.listen, Random(f"instruments {seed}"))
