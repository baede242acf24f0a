"""What `dash` and `teleop` share: their options, and how a full-screen program is started.

`diffbotctl dash`: the dashboard of a running engine.

`diffbotctl teleop`: drive a running engine's robot with the keys.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.engine_client import engine_option, quantity_of

if TYPE_CHECKING:
    from diffbotctl.ui.engine_app import EngineApp, ScreenOptions


def screen_options(command: Callable[..., Any]) -> Callable[..., Any]:
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


def screen_options_of(
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


@click.command()
@click.option("--once", is_flag=True, help="Print the panels once and end; so does a pipe.")
@click.option("--plot", "fields", multiple=True, metavar="FIELD", help="What to plot. Repeatable.")
@screen_options
@engine_option
def dash(
    once: bool,
    fields: tuple[str, ...],
    keys: str,
    mode: str,
    hz: float,
    speed: str | None,
    turn: str | None,
    ascii_only: bool,
    engine: str | None,
) -> int:
    """Show a running engine on one screen: map, wheels, range, link, plots, parameters, log.

    Click on the map and the robot goes there; drag, and it looks that way when it arrives. `?`
    shows every key.
    """
    import sys

    from diffbotctl.control_socket.client import choose_engine

    wishes = screen_options_of(keys, mode, hz, speed, turn, ascii_only)
    if once or not sys.stdout.isatty():
        from diffbotctl.ui.dash.print_once import print_once

        print_once(choose_engine(engine), wishes, list(fields))
        return 0
    from diffbotctl.ui.dash.app import Dashboard

    return launch(Dashboard(choose_engine(engine), "diffbotctl dash", wishes, list(fields)))


@click.command()
@screen_options
@engine_option
def teleop(
    keys: str,
    mode: str,
    hz: float,
    speed: str | None,
    turn: str | None,
    ascii_only: bool,
    engine: str | None,
) -> int:
    """Drive by hand: arrows, or u i o j k l m , . as in ROS, or w a s d x (`--keys turtle`).

    A key drives while it is held, and 0.4 s longer. With `--mode latched` it drives until the next
    key, as ROS did, as long as this terminal answers. Whatever ends this ends the driving.
    """
    import sys

    from diffbotctl.control_socket.client import choose_engine

    found = choose_engine(engine)
    if not sys.stdin.isatty() or not sys.stdout.isatty():
        raise click.UsageError(
            "teleop needs a terminal for its keys; from a program speak to the socket, or use "
            "`diffbotctl drive --v 0.1 --for 1s`"
        )
    from diffbotctl.ui.teleop.app import Teleop

    return launch(
        Teleop(
            found, "diffbotctl teleop", screen_options_of(keys, mode, hz, speed, turn, ascii_only)
        )
    )
