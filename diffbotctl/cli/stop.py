"""`diffbotctl stop`: stop the robot, whatever else is broken.

By the control socket first: the robot is held, the run goes on. Where nobody answers there, the
engine is ended by a signal, which ends in a confirmed stop; and where it does not end either, it is
killed, so that the board's dead-man or the guardian stops the motors.

`diffbotctl resume`: a person's consent to move again.

`diffbotctl why`: the cause chain of the last stop.
"""

from __future__ import annotations

import os
import signal
import time
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.engine_client import attached, engine_option, held_by, settled

if TYPE_CHECKING:
    from diffbotctl.control_socket.address import EngineAddress, Process

ENDING_TIME = 4.0  # s; a final stop may take 2 s to be confirmed
EXIT_POLL_PERIOD_S = 0.02  # s between two looks whether it has ended


@click.command()
@engine_option
@click.option("--all", "everyone", is_flag=True, help="As without --engine; no error for none.")
@click.argument("reason", nargs=-1)
def stop(engine: str | None, everyone: bool, reason: tuple[str, ...]) -> int:
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
        time.sleep(EXIT_POLL_PERIOD_S)
    return True


@click.command()
@engine_option
def resume(engine: str | None) -> int:
    """Let the robot move again after a stop that waits for a person. A waiting goal goes on.

    It ends what holds the robot now, not what may stop it later; where nothing was stopped and no
    goal waited, it says so and fails.
    """
    with attached(engine, "resume") as caller:
        before = caller.ask("status")
        caller.ask("resume")
        if held_by(before):
            after = settled(caller, lambda status: not held_by(status))
        elif waits(before):
            after = settled(caller, lambda status: not waits(status))
        else:
            after = before
    done, words = outcome(before, after)
    click.echo(words, err=not done)
    return 0 if done else 1


def waits(status: dict[str, Any]) -> bool:
    """Whether a goal was withdrawn while a person drove, and waits for consent."""
    goal = status["operator.goal"]
    return goal is not None and goal["number"] == 0


def outcome(before: dict[str, Any], after: dict[str, Any]) -> tuple[bool, str]:
    """Whether the consent ended anything, and what to say of it: the status before and after."""
    held, still = held_by(before), held_by(after)
    if still and (after["held"]["latched"] or still == held):
        way_out = (
            "" if after["held"]["latched"] else "; that ends by itself when its cause has gone"
        )
        return False, f"still held by {still}{way_out}"
    done = [f"released from {held}"] if held else []
    if waits(before) and not waits(after):
        done.append(f"goal {after['operator.goal']['number']} goes on")
    if still:
        done.append(f"now held by {still}, which ends by itself")
    if done:
        return True, "; ".join(done)
    return False, f"nothing is stopped and no goal waits, so nothing was done; {_goal(after)}"


def _goal(status: dict[str, Any]) -> str:
    from diffbotctl.messages import GoalState
    from diffbotctl.recording.json_codec import message_reader
    from diffbotctl.ui.run_text import goal_state_text

    said = status["goal_state"]
    if said is None:
        return "no goal is under way"
    state: GoalState = message_reader(GoalState)(said)
    return f"goal {state.number}: {goal_state_text(state)}"


@click.command()
@engine_option
def why(engine: str | None) -> int:
    """Tell why the robot last stopped, from the sensor to the motors, and what ends it."""
    with attached(engine, "why") as caller:
        text = caller.ask("why")["text"]
    click.echo(click.wrap_text(text, 78))
    return 0
