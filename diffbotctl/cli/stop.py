"""`diffbotctl stop`: stop the robot, whatever else is broken.

By the control socket first: the robot is held, the run goes on. Where nobody answers there, the
engine is ended by a signal, which ends in a confirmed stop; and where it does not end either, it is
killed, so that the board's dead-man or the guardian stops the motors.
"""

from __future__ import annotations

import os
import signal
import time
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.engine_client import attached, engine_option, settled

if TYPE_CHECKING:
    from diffbotctl.control_socket.address import EngineAddress, Process

ENDING_TIME = 4.0  # s; a final stop may take 2 s to be confirmed
LOOK = 0.02  # s between two looks whether it has ended


@click.command()
@engine_option
@click.option("--all", "everyone", is_flag=True, help="As without --engine; no error for none.")
@click.argument("reason", nargs=-1)
def command(engine: str | None, everyone: bool, reason: tuple[str, ...]) -> int:
    """Hold the robot until `diffbotctl resume`; REASON is shown to others.

    Without --engine all are stopped that you may speak to: nobody in a hurry is asked which.
    """
    from diffbotctl.control_socket.address import engines
    from diffbotctl.control_socket.client import choose_engine

    wanted = engines() if engine is None else [choose_engine(engine)]
    if not wanted and not everyone:
        choose_engine(None)  # says that there is none
    return max((_stop(each, " ".join(reason)) for each in wanted), default=0)


def _stop(engine: EngineAddress, reason: str) -> int:
    from diffbotctl.errors import UserError

    try:
        trouble = _by_socket(engine.name, reason)
    except (UserError, OSError) as error:
        trouble = str(error)
    if not trouble:
        return 0
    click.echo(trouble, err=True)
    if engine.process is None:
        click.echo("nobody knows its process: switch the robot off", err=True)
        return 1
    return _by_signal(engine.name, engine.process)


def _by_socket(name: str, reason: str) -> str:
    """Ask for a stop and see it happen: what went wrong, or nothing."""
    with attached(name, "stop") as caller:
        caller.ask("stop", why=reason[:200])
        status = settled(caller, _is_stopped)
    if not _is_stopped(status):
        return f"{name}: it was told to stop, but still sends motion to the wheels"
    click.echo(f"{name}: stopped; `diffbotctl resume` lets it go")
    return ""


def _is_stopped(status: dict[str, Any]) -> bool:
    held, wheels = status["gate.stop"], status["gate.wheels"]
    still = wheels is None or (wheels["left"] == 0 and wheels["right"] == 0)
    return still and held is not None and bool(held["code"])


def _by_signal(name: str, process: Process) -> int:
    for number, words in (
        (signal.SIGTERM, "asked to end by a signal"),
        (signal.SIGKILL, "killed: now the board's dead-man, or the guardian, stops the motors"),
    ):
        click.echo(f"{name}: process {process.pid} is {words}", err=True)
        if not _send(process, number):
            click.echo(f"{name}: it belongs to another user: switch the robot off", err=True)
            return 1
        if _ends(process):
            click.echo(f"{name}: ended")
            return 0
    click.echo(f"{name}: it does not even die: switch the robot off", err=True)
    return 1


def _send(process: Process, number: int) -> bool:
    if not process.is_alive:
        return True
    try:
        os.kill(process.pid, number)
        os.kill(process.pid, signal.SIGCONT)  # one that was frozen must wake up to stop the robot
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    return True


def _ends(process: Process) -> bool:
    deadline = time.monotonic() + ENDING_TIME
    while process.is_alive:
        if time.monotonic() > deadline:
            return False
        time.sleep(LOOK)
    return True
