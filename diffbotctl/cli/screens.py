"""`diffbotctl dash` and `teleop`: the full-screen programs."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from diffbotctl.cli.command import command, option
from diffbotctl.cli.contradictions import exclusive
from diffbotctl.cli.engine_client import host
from diffbotctl.cli.options import (
    ASCII,
    ENGINE,
    VIEW,
    choice_option,
    number_option,
    quantity_option,
)
from diffbotctl.cli.run_dash import check_can_draw

if TYPE_CHECKING:
    from diffbotctl.ui.engine_app import EngineApp, ScreenOptions
    from diffbotctl.ui.teleop.keyboard import DriveMode, KeySetName


class ScreenArguments(NamedTuple):
    """Keys, mode, speeds, and how the screen is drawn."""

    keys: KeySetName = choice_option(
        ("twist", "turtle"), "Key layout: u i o j k l m , . as in ROS, or w a s d x."
    )
    mode: DriveMode = choice_option(
        ("hold", "latched"), "Drive while a key is held, or until the next key."
    )
    hz: float = number_option(10.0, 0.5, 30.0, "Screen updates per second.")
    speed: float | None = quantity_option(
        "m/s", "Initial speed of the keys; default: half the robot's limit."
    )
    turn: float | None = quantity_option(
        "rad/s", "Initial turning speed of the keys, such as 45deg/s."
    )
    ascii_only: bool = ASCII

    def options(self) -> ScreenOptions:
        """The options of an EngineApp."""
        from diffbotctl.ui.engine_app import ScreenOptions

        is_utf8 = (sys.stdout.encoding or "ascii").lower().replace("-", "") == "utf8"
        speed, turn = (None if rate is None else abs(rate) for rate in (self.speed, self.turn))
        ascii_only = self.ascii_only or not is_utf8
        return ScreenOptions(self.keys, self.mode, self.hz, speed, turn, ascii_only)


def launch(app: EngineApp) -> int:
    """Run the screen to its end. Raises RunError when the engine did not answer."""
    from diffbotctl.processes.screen import DRIVING_NICENESS

    os.nice(DRIVING_NICENESS)
    code = app.run_to_end()
    if app.problem is not None:
        raise app.problem
    if app.run_view.ended:
        click.echo("the run has ended")
    return code


@command("Look", 1, "Show a running engine on one screen")
@exclusive(
    "--once",
    ("--keys", "--mode", "--hz", "--speed", "--turn"),
    "it prints the panels and takes no keys",
)
def dash(
    screen: ScreenArguments,
    once: bool = option("Print the panels once and end, as in a pipe."),
    fields: tuple[str, ...] = option("--plot", "What to plot. Repeatable.", metavar="FIELD"),
    view_file: Path | None = VIEW,
    engine: str | None = ENGINE,
) -> int:
    """Show a running engine on one screen: map, wheels, range, link, plots, parameters, log.

    Click on the map to send the robot there; drag to set its heading at the goal. `?` shows every
    key.
    """
    from diffbotctl.control_socket.client import choose_engine

    options = screen.options()
    from diffbotctl.ui.saved_view import ViewSettings, read_view

    view = ViewSettings() if view_file is None else read_view(str(view_file))
    if fields:
        view = view._replace(fields=fields)
    if not once and sys.stdout.isatty():
        check_can_draw("dash")
    if once or not sys.stdout.isatty():
        from diffbotctl.ui.dash.print_once import print_once

        print_once(choose_engine(engine, host()), list(view.fields), options.ascii_only)
        return 0
    from diffbotctl.ui.dash.app import Dashboard

    return launch(Dashboard(choose_engine(engine, host()), "diffbotctl dash", options, view))


@command("Drive", 5, "Drive with the keys")
def teleop(screen: ScreenArguments, engine: str | None = ENGINE) -> int:
    """Drive by hand: arrows, or u i o j k l m , . as in ROS, or w a s d x (`--keys turtle`).

    A key drives while it is held, and for 0.4 s after. With `--mode latched` it drives until the
    next key, as in ROS, while this terminal answers. The end of this program ends the driving.
    """
    from diffbotctl.control_socket.client import choose_engine

    address = choose_engine(engine, host())
    if not sys.stdin.isatty() or not sys.stdout.isatty():
        raise click.UsageError(
            "teleop needs a terminal for its keys; a program uses the control socket, or "
            "`diffbotctl drive --speed 0.1 --for 1s`"
        )
    check_can_draw("teleop")
    from diffbotctl.ui.teleop.app import Teleop

    options = screen.options()
    return launch(Teleop(address, "diffbotctl teleop", options))
