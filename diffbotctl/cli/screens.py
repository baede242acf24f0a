"""The full-screen programs: `diffbotctl dash`, `teleop`, and the dashboard of `run --dash`."""

from __future__ import annotations

import os
import signal
import sys
import termios
import time
from collections.abc import Iterator
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
from diffbotctl.errors import Problem, RunError, UserError

if TYPE_CHECKING:
    from diffbotctl.control_socket.address import EngineAddress
    from diffbotctl.processes.screen import RunSnapshot
    from diffbotctl.ui.engine_app import EngineApp, ScreenOptions
    from diffbotctl.ui.saved_view import ViewSettings
    from diffbotctl.ui.teleop.keyboard import DriveMode, KeySetName

SOCKET_TIMEOUT_S = 10.0  # s for the engine's socket to stand
POLL_PERIOD_S = 0.01  # s between two looks for it
# CAN ends a control sequence in which the dashboard was killed. Then: leave the alternate screen;
# no mouse, no focus reports, no bracketed paste; show the cursor.
TERMINAL_BACK = (
    "\x18\x1b[?1049l\x1b[?1000l\x1b[?1002l\x1b[?1003l\x1b[?1006l\x1b[?1004l\x1b[?2004l\x1b[?25h"
)
GONE = "the dashboard is gone; the run goes on: Ctrl-C ends it, `diffbotctl dash` looks again"


def check_terminal(has_socket: bool) -> None:
    """Raises click.UsageError where there can be no dashboard."""
    if not has_socket:
        raise click.UsageError("--dash needs the control socket: leave out --fast and --no-socket")
    if not sys.stdin.isatty() or not sys.stdout.isatty():
        raise click.UsageError("--dash needs a terminal; without one run prints lines")
    check_can_draw("--dash")


def check_can_draw(name: str) -> None:
    """Raises click.UsageError for a terminal on which `name` cannot draw."""
    if is_dumb_terminal():
        kind = os.environ.get("TERM", "")
        raise click.UsageError(
            f"{name} needs a terminal that can draw (TERM is '{kind}'): use another one, or "
            "set TERM to what it is, such as TERM=xterm-256color"
        )


def is_dumb_terminal() -> bool:
    """Whether TERM names a terminal that prints lines and nothing else."""
    return os.environ.get("TERM", "").lower() in ("", "dumb", "unknown")


class SavedTerminal:
    """The terminal as it was, for the engine to give back should the dashboard be killed.

    `words` are the messages of the engine in the meantime.
    """

    def __init__(self) -> None:
        self.words: list[str] = []
        self.settings = termios.tcgetattr(sys.stdin.fileno())

    def give_back(self) -> None:
        """Make the terminal usable again: its Ctrl-C is the only key left to end the run."""
        self._restore(f"{TERMINAL_BACK}{GONE}\r\n")

    def end(self) -> None:
        """After the run: restore what a dashboard left that was interrupted while it started."""
        if termios.tcgetattr(sys.stdin.fileno()) != self.settings:
            self._restore(TERMINAL_BACK)

    def _restore(self, text: str) -> None:
        termios.tcsetattr(sys.stdin.fileno(), termios.TCSANOW, self.settings)
        os.write(sys.stdout.fileno(), text.encode())


def show(pictures: Iterator[RunSnapshot], view: ViewSettings | None = None) -> None:
    """What the child runs: a dashboard at its parent's socket. Leaving it ends the run.

    `view`: what it shows at first.
    """
    from diffbotctl.ui.dash.app import Dashboard
    from diffbotctl.ui.engine_app import ScreenOptions

    parent = os.getppid()
    try:
        dashboard = Dashboard(engine_of(parent), "diffbotctl run --dash", ScreenOptions(), view)
        dashboard.run_to_end()
        if dashboard.problem is not None:
            print(dashboard.problem, file=sys.stderr)
        ended = dashboard.run_view.ended
    except UserError as error:
        print(error, file=sys.stderr)
        ended = False
    if not ended and os.getppid() == parent:
        os.kill(parent, signal.SIGINT)
        for _ in pictures:  # until the engine has ended: it takes an earlier end for a death
            pass


def engine_of(pid: int) -> EngineAddress:
    from diffbotctl.control_socket.address import engines

    deadline = time.monotonic() + SOCKET_TIMEOUT_S
    while time.monotonic() < deadline:
        for engine in engines():
            if engine.process is not None and engine.process.pid == pid:
                return engine
        time.sleep(POLL_PERIOD_S)
    raise RunError(Problem("E-NO-ENGINE", "--dash", "the engine's socket never stood", "see above"))


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
