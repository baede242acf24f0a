"""Rigs for each kind of robot: simulated, on an emulated board, or real behind a port."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from diffbotctl.calibrate.heard import Keys
from diffbotctl.calibrate.instruments import Truths
from diffbotctl.calibrate.rig import Make, Rig
from diffbotctl.config.configuration import RobotFile
from diffbotctl.drivers.emulated import Emulated, EmulatedBoard
from diffbotctl.drivers.simulated import Simulated
from diffbotctl.engine.clock import PacedClock, VirtualClock
from diffbotctl.engine.driver import RobotDriver
from diffbotctl.links.diffbot import DiffbotHost
from diffbotctl.plant.robot import SimulatedRobot
from diffbotctl.plant.world import World
from diffbotctl.runs.emulation import emulated_board, settings_of
from diffbotctl.runs.real import serial_robot
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
        made = Rig(file, _emulated(board), VirtualClock(), keys)
        return made, _truths(board.plant, made, seed)
    return Rig(file, _real(port, tell), PacedClock(exact=False), keys), None


def _truths(plant: SimulatedRobot, made: Rig, seed: int) -> Truths:
    return Truths(plant, made.listen, Random(f"instruments {seed}"))


def _simulated(plant: SimulatedRobot) -> Make:
    def make(file: RobotFile, before: RobotDriver | None, now: int) -> RobotDriver:
        if before is not None:
            plant.advance(now)
            plant.rewire(machine(file.robot, file.nominal))
        return Simulated(plant, takes_duty(file.robot))

    return make


def _emulated(board: EmulatedBoard) -> Make:
    def make(file: RobotFile, before: RobotDriver | None, now: int) -> RobotDriver:
        board.advance(now)
        board.received.clear()
        return Emulated(board, DiffbotHost(settings_of(file.robot)))

    return make


def _real(device: str, tell: Callable[[str], None]) -> Make:
    def make(file: RobotFile, before: RobotDriver | None, now: int) -> RobotDriver:
        if before is not None:
            before.close()
        return serial_robot(file.robot, device, tell, now)

    return make
