"""What `dash` and `teleop` share: their options, and how a full-screen program is started."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.engine_client import quantity_of

if TYPE_CHECKING:
    from diffbotctl.ui.engine_app import EngineApp, ScreenOptions


def cockpit_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Keys, mode, speeds, and how it is drawn."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command


OPTIONS = (
    click.option(
        "--keys",
        type=click.Choice(["twist", "turtle"]),
        default="twist",
        show_default=True,
        help="u i o j k l m , . as in ROS, or w a s d x.",
    ),
    click.option(
        "--mode",
        type=click.Choice(["hold", "latched"]),
        default="hold",
        show_default=True,
        help="Drive while a key is held, or until the next key.",
    ),
    click.option(
        "--hz",
        type=click.FloatRange(0.5, 30.0),
        default=10.0,
        show_default=True,
        help="Pictures a second.",
    ),
    click.option("--speed", metavar="SPEED", help="To begin with; half the limit if not given."),
    click.option("--turn", metavar="RATE", help="To begin with, such as 45deg/s."),
    click.option("--ascii", "ascii_only", is_flag=True, help="Draw with letters only."),
)


def wishes_of(
    keys: str, mode: str, hz: float, speed: str | None, turn: str | None, ascii_only: bool
) -> ScreenOptions:
    """The options as a cockpit takes them. Raises click.UsageError."""
    from diffbotctl.ui.engine_app import ScreenOptions

    knows_more = (sys.stdout.encoding or "ascii").lower().replace("-", "") == "utf8"
    return ScreenOptions(
        keys,
        mode,
        hz,
        None if speed is None else abs(quantity_of(speed, "m/s", "--speed")),
        None if turn is None else abs(quantity_of(turn, "rad/s", "--turn")),
        ascii_only or not knows_more,
    )


def launch(cockpit: EngineApp) -> int:
    """Run it to its end. Raises RunError when the engine did not answer."""
    code = cockpit.run_to_end()
    if cockpit.problem is not None:
        raise cockpit.problem
    if cockpit.sight.ended:
        click.echo("the run has ended")
    return code
