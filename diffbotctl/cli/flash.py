"""`diffbotctl flash firmware`: our program onto a Mega 2560, and the robot's settings after it.

`diffbotctl blink`: does the board hear us? No motor moves.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterable

    from diffbotctl.board.progress import Event

FLOATS = """\
After each reset the board's pins float for 0.83 s, and a motor driver whose
inputs float may turn the wheels. Lift them off the ground, or switch the
motors' supply off."""
STILL_ROSSERIAL = """\
Note: {file} says link: {{protocol: rosserial}}, which this board no longer speaks. Say
link: {{protocol: diffbot}} there before the next run."""
INTERRUPTED = "\nInterrupted. The bootloader is untouched: flash again whenever you like."


@click.command()
@click.argument("what", type=click.Choice(["firmware"]))
@click.option("--port", default="auto", show_default=True, help="The board's USB port, or auto.")
@click.option("--robot", help="Robot file whose settings are sent; the rules of `run` for none.")
@click.option(
    "--programmer",
    type=click.Choice(["built-in", "avrdude"]),
    default="built-in",
    show_default=True,
    help="Who speaks to the bootloader.",
)
@click.option(
    "--backup", type=click.Path(dir_okay=False, path_type=Path), help="First save what is on it."
)
@click.option(
    "--hex", "image", type=click.Path(dir_okay=False, path_type=Path), help="Another program."
)
@click.option("--yes", is_flag=True, help="Ask nothing: the wheels are lifted.")
def flash(
    what: str,
    port: str,
    robot: str | None,
    programmer: str,
    backup: Path | None,
    image: Path | None,
    yes: bool,
) -> None:
    """Write the FIRMWARE through the board's bootloader, verify it, and send the settings.

    An interrupted flash leaves a board that can be flashed again.
    """
    from diffbotctl.cli.choose_port import choose_port
    from diffbotctl.config.load import load_robot
    from diffbotctl.config.lookup import folder
    from diffbotctl.drivers.board_candidates import refuse_radio
    from diffbotctl.drivers.robot_link import board_settings
    from diffbotctl.flash.flasher import flash, load

    device = choose_port() if port == "auto" else port
    refuse_radio(device)
    file = load_robot(robot)
    ours = image is None
    program = folder("firmware") / "diffbot_mega2560.hex" if image is None else image
    load(program)
    settings = board_settings(file.robot) if ours else None
    click.echo(f"robot {file.file}, port {device}")
    click.echo(FLOATS)
    if not yes and not _agreed():
        raise click.Abort
    _show(flash(device, program, programmer=programmer, backup=backup, settings=settings))
    if ours and file.robot.link.protocol == "rosserial":
        click.echo(STILL_ROSSERIAL.format(file=file.file))


def _agreed() -> bool:
    if not sys.stdin.isatty():
        raise click.UsageError("Nobody is there to say that the wheels are lifted: add --yes.")
    return click.confirm("Are the wheels in the air, or the motors without supply?")


def _show(events: Iterable[Event]) -> None:
    from diffbotctl.ui.progress import show_progress

    try:
        show_progress(events)
    except KeyboardInterrupt:
        click.echo(INTERRUPTED, err=True)
        raise click.Abort from None


@click.command()
@click.option("--port", default="auto", show_default=True, help="The board's port, or auto.")
@click.option("--robot", help="Robot file; the rules of `run` for none.")
@click.option("--times", default=10, show_default=True, type=click.IntRange(1, 1000))
def blink(port: str, robot: str | None, times: int) -> None:
    """Check a board in a minute: make the link, and blink its light. No motor moves."""
    from diffbotctl.board.blink import blink
    from diffbotctl.cli.choose_port import choose_port
    from diffbotctl.config.load import load_robot
    from diffbotctl.drivers.robot_link import diffbot_host

    device = choose_port(radio=True) if port == "auto" else port
    file = load_robot(robot)
    click.echo(f"robot {file.file}, port {device}")
    for said in blink(device, diffbot_host(file.robot, device), times):
        click.echo(said.text)
