"""`diffbotctl emulate`: a virtual board with the robot behind it, to try everything on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import command, option
from diffbotctl.cli.contradictions import exclusive
from diffbotctl.cli.options import ROBOT_OBJECT, SEED
from diffbotctl.errors import ConfigurationError, Problem
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.config.robot import Robot
    from diffbotctl.plant.world import World

TRY = """\
Now, from another terminal:
  diffbotctl flash firmware --robot {robot} --port {usb}
  diffbotctl blink --robot {robot} --port {usb}
  diffbotctl run goal --robot {robot} --port {port}
Ctrl-C ends the board."""


@command("Run", 3, "Start a virtual board that runs the real firmware")
@exclusive("--blank", ("--hex",), "a blank board has no program")
def emulate(
    blank: bool = option("Start with the stock bootloader only."),
    image: Path | None = option("--hex", "Run this program instead of the firmware."),
    world: str | None = option("Use the walls of this pipeline.", metavar="PIPELINE"),
    seed: int = SEED,
    robot: str | None = ROBOT_OBJECT,
) -> None:
    """Start a virtual board that runs the real firmware, wired to the simulated ROBOT.

    Prints the board's ports and runs in real time until Ctrl-C. Use the ports from another
    terminal as those of a real board: flash, run --port, blink. The motion of the wheels is printed
    here.
    """
    from diffbotctl.cli.standard_streams import NonBlockingStderr
    from diffbotctl.config.load import load_robot
    from diffbotctl.drivers.robot_link import board_settings
    from diffbotctl.emulator.program import image_of
    from diffbotctl.emulator.virtual_board import virtual_board
    from diffbotctl.flash.flasher import check_chip, load
    from diffbotctl.runs.signals import Signals

    file = load_robot(robot)
    if image is None and not blank:
        image = image_of(board_settings(file.nominal).board)
        _speaks_ours(file.robot, str(file.file))
    if image is not None:
        check_chip(image, load(image), board_settings(file.nominal).board)
    walls = None if world is None else _walls(world, robot)
    signals = Signals()
    with virtual_board(file.nominal, seed, walls, image) as board:
        what = "nothing but its bootloader" if image is None else image.name
        what = f"EMULATED board with {what}, SIMULATED robot {file.file} (seed {seed})"
        click.echo(fold_text(what, hang=2))
        click.echo(f"USB port    {board.usb}")
        if board.radio is not None:
            click.echo(f"radio port  {board.radio}")
        port = board.radio if board.radio and file.robot.link.has_radio else board.usb
        name = robot or file.file
        click.echo(TRY.format(robot=name, usb=board.usb, port=port))
        aside = NonBlockingStderr()  # a terminal that takes nothing must not stop the board's time
        board.serve(signals.file, aside.say)
        aside.end()
        if board.lost:
            click.echo(f"Board paused for {board.lost:.1f} s: the computer was busy.", err=True)


def _speaks_ours(robot: Robot, file: str) -> None:
    if robot.link.protocol != "diffbot":
        cause = (
            f"the virtual board runs our firmware, but this robot's board speaks "
            f"{robot.link.protocol}"
        )
        fix = "take a robot with link: {protocol: diffbot}, or give its own program with --hex FILE"
        raise ConfigurationError(Problem("E-EMULATOR", file, cause, fix))


def _walls(pipeline: str, robot: str | None) -> World:
    from diffbotctl.config.load import load
    from diffbotctl.plant.world import build_world

    return build_world(load(pipeline, robot, ()).world)
