"""`diffbotctl flash firmware`: our program onto the board, and the robot's settings after it.

`diffbotctl blink`: check the connection to the board. No motor moves.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.choose_port import choose_board_port, choose_port
from diffbotctl.cli.command import argument, command, option
from diffbotctl.cli.options import ROBOT, YES, choice_option, number_option, port_option
from diffbotctl.config.lookup import folder

if TYPE_CHECKING:
    from collections.abc import Iterable

    from diffbotctl.flash.board_session import JobEvent

FLOATS = """\
After each reset the board's pins float for 0.83 s, and a motor driver with
floating inputs may turn the wheels. Lift the wheels off the ground, or switch
the motors' power off."""
LIFT = "Lift the wheels off the ground, or switch the motors' power off."
STILL_ROSSERIAL = (
    "Note: {file} has link: {{protocol: rosserial}}, which this board no longer uses. Change it "
    "to link: {{protocol: diffbot}} before the next run."
)
INTERRUPTED = "\nInterrupted. The bootloader is intact: run `flash firmware` again at any time."


@command("Set up", 3, "Write the firmware to the board")
def flash(
    what: str = argument(type=click.Choice(["firmware"])),
    port: str = port_option("auto", only_board=True),
    robot: str | None = ROBOT,
    programmer: str = choice_option(
        ("built-in", "avrdude"), "The program that speaks to the bootloader."
    ),
    backup: Path | None = option("First save the board's present program to FILE."),
    image: Path | None = option("--hex", "Write this program instead of the firmware."),
    yes: bool = YES,
) -> None:
    """Write the firmware through the board's bootloader, verify it, and send the settings.

    The board can be flashed again after an interruption.
    """
    from diffbotctl.config.board_pins import BOARDS
    from diffbotctl.drivers.board_ports import refuse_other_board, refuse_radio
    from diffbotctl.drivers.robot_link import board_settings
    from diffbotctl.drivers.robot_ports import load_robot_at
    from diffbotctl.flash.flasher import flash, load
    from diffbotctl.flash.pico import find_pico, flash_pico
    from diffbotctl.links.diffbot_frames import BoardCode

    file = load_robot_at(port, robot)
    ours = image is None
    settings = board_settings(file.robot)
    program = folder("firmware") / BOARDS[file.robot.board.type].image if image is None else image
    if settings.board is BoardCode.RP2040:
        _refuse_for_pico(programmer, backup)
        target = find_pico(port)
        load(program)
        click.echo(f"robot {file.file}, Pico on {target.place}")
        click.echo(LIFT)
        if not yes and not _agreed():
            raise click.Abort
        _show(flash_pico(target, program, settings if ours else None))
        return
    device = choose_board_port(settings.board) if port == "auto" else port
    refuse_radio(device)
    refuse_other_board(device, settings.board)
    load(program)
    click.echo(f"robot {file.file}, port {device}")
    click.echo(FLOATS)
    if not yes and not _agreed():
        raise click.Abort
    events = flash(
        device,
        program,
        programmer=programmer,
        backup=backup,
        board=settings.board,
        settings=settings if ours else None,
    )
    _show(events)
    if ours and file.robot.link.protocol == "rosserial":
        click.echo(STILL_ROSSERIAL.format(file=file.file))


def _refuse_for_pico(programmer: str, backup: Path | None) -> None:
    """A Pico has no serial bootloader: the program is copied onto its drive."""
    from diffbotctl.drivers.board_ports import NoBackupError, NoProgrammerError

    if backup is not None:
        raise NoBackupError("--backup", "a Pico's boot ROM does not show the program on it")
    if programmer != "built-in":
        raise NoProgrammerError("it does not flash a Pico", "leave --programmer out")


def _agreed() -> bool:
    if not sys.stdin.isatty():
        raise click.UsageError("no terminal to confirm that the wheels are lifted: add --yes")
    return click.confirm("Are the wheels off the ground, or the motors without power?")


def _show(events: Iterable[JobEvent]) -> None:
    try:
        _show_progress(events)
    except KeyboardInterrupt:
        click.echo(INTERRUPTED, err=True)
        raise click.Abort from None


def _show_progress(events: Iterable[JobEvent]) -> None:
    """Progress of a job: a bar on a terminal, plain lines without one."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

    from diffbotctl.flash.board_session import JobMessage
    from diffbotctl.ui.console import PrintableConsole

    console = PrintableConsole(highlight=False)
    columns = (TextColumn("{task.description:<8}"), BarColumn(), TaskProgressColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bars:
        tasks = {}
        for event in events:
            if isinstance(event, JobMessage):
                bars.console.print(event.text, markup=False)
                continue
            if event.what not in tasks:
                tasks[event.what] = bars.add_task(event.what, total=event.total)
            bars.update(tasks[event.what], completed=event.done)


@command("Set up", 4, "; blink its light")
def blink(
    port: str = port_option("auto", only_board=True),
    robot: str | None = ROBOT,
    times: int = number_option(10, 1, 1000, "How often the light blinks."),
) -> None:
    """Connect to the board and blink its light: board, cable and port work. No motor moves."""
    from diffbotctl.config.motor_pulses import pulses_text
    from diffbotctl.drivers.robot_link import diffbot_host
    from diffbotctl.drivers.robot_ports import load_robot_at
    from diffbotctl.flash.board_jobs import blink

    device = choose_port(radio=True) if port == "auto" else port
    file = load_robot_at(device, robot)
    click.echo(f"robot {file.file}, port {device}")
    host = diffbot_host(file.robot, device)
    for report in blink(device, host, times):
        click.echo(report.text)
    click.echo(pulses_text(file.robot))
