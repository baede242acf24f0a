"""`diffbotctl flash firmware`: our program onto a Mega 2560, and the robot's settings after it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterable

    from diffbotctl.flash.events import Event

FLOATS = """\
While the board is being written its pins float for about 0.8 s: a driver whose inputs
float may turn the wheels. Lift the wheels off the ground, or switch the motor battery off."""


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
def command(
    what: str, port: str, robot: str | None, programmer: str, backup: Path | None,
    image: Path | None, yes: bool,
) -> None:  # fmt: skip
    """Write the FIRMWARE through the board's bootloader, verify it, and send the settings.

    An interrupted flash leaves a board that can be flashed again.
    """
    from diffbotctl.config.load import load_robot
    from diffbotctl.config.resources import folder
    from diffbotctl.flash.find import refuse_radio
    from diffbotctl.flash.job import flash
    from diffbotctl.runs.emulation import settings_of

    device = _device(port)
    refuse_radio(device)
    file = load_robot(robot)
    click.echo(f"robot {file.file}, port {device}")
    click.echo(FLOATS)
    if not yes and not _agreed():
        raise click.Abort
    ours = image is None
    program = folder("firmware") / "diffbot_mega2560.hex" if image is None else image
    settings = settings_of(file.robot) if ours else None
    _show(flash(device, program, programmer=programmer, backup=backup, settings=settings))


def _agreed() -> bool:
    if not sys.stdin.isatty():
        raise click.UsageError("Nobody is there to say that the wheels are lifted: add --yes.")
    return click.confirm("Go on?")


def _device(port: str) -> str:
    from diffbotctl.flash.find import candidates, choose
    from diffbotctl.flash.trouble import SeveralBoardsError

    if port != "auto":
        return port
    found = candidates()
    try:
        return choose(found).device
    except SeveralBoardsError:
        if not sys.stdin.isatty():
            raise
    for number, each in enumerate(found, 1):
        click.echo(f"{number}  {each.device}  {each.title}")
    number = click.prompt("Which board", type=click.IntRange(1, len(found)))
    return found[number - 1].device


def _show(events: Iterable[Event]) -> None:
    from diffbotctl.ui.progress import show

    show(events)
