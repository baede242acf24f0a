"""`run --dash`: the dashboard as a run's own screen, in a child process of the engine."""

from __future__ import annotations

import os
import signal
import sys
import termios
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from diffbotctl.errors import Problem, RunError, UserError

if TYPE_CHECKING:
    from diffbotctl.control_socket.address import EngineAddress
    from diffbotctl.processes.screen import RunSnapshot
    from diffbotctl.ui.saved_view import ViewSettings

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
