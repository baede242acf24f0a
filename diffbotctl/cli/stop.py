"""`diffbotctl stop`, `resume` and `why`: stop the robot, allow it to move, explain a stop.

`stop` asks over the control socket first: the robot is held and the run continues. When the engine
does not answer, it is ended by a signal, which ends in a confirmed stop. When it does not end
either, it is killed; the board's dead-man or the watchdog process then stops the motors.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import command, option
from diffbotctl.cli.engine_client import attached, held_by, host, settled
from diffbotctl.cli.options import ENGINE, JSON
from diffbotctl.cli.output import print_row
from diffbotctl.errors import UsageError, UserError
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.control_socket.address import EngineAddress, Process

FAR_STOP_TIMEOUT_S = 2.0  # with the start of this program it is known within 3 s
EXIT_TIMEOUT_S = 10.0  # 2 s to confirm a stop, then a last picture, and a recording on a slow card
EXIT_POLL_PERIOD_S = 0.02
REASON_MAX_CHARACTERS = 200


class UnconfirmedStopError(Exception):
    """The engine holds the robot, but its board does not answer."""


@command("Drive", 1, "Stop the robot")
def stop(
    reason: tuple[str, ...],
    engine: tuple[str, ...] = option(
        "Name of the engine; all of them without it. Repeatable.", metavar="NAME"
    ),
    hosts: tuple[str, ...] = option(
        "--at",
        "The engines on this computer, reached through ssh. Repeatable: all at once.",
        metavar="USER@HOST",
    ),
    every_engine: bool = option(
        "--all", "All engines, also with --engine; no error when none runs."
    ),
) -> int:
    """Stop the robot until `diffbotctl resume`; REASON is shown to other users.

    Without --engine, all engines that you may command are stopped, with --at those there. Exit
    code: 1 when a stop was not confirmed.
    """
    from diffbotctl.control_socket.address import engines
    from diffbotctl.control_socket.client import choose_engine

    # A stop is never refused for its options: the one that stops more counts.
    text, names = " ".join(reason), {} if every_engine else dict.fromkeys(engine)
    stops: dict[str, Callable[[], int]]
    if hosts:
        targets = [(host, name) for host in dict.fromkeys(hosts) for name in names or (None,)]
        stops = {
            f"{host}: {name}" if name else host: partial(_stop_far, host, name, text)
            for host, name in targets
        }
    elif names:
        stops = {name: partial(_stop_named, name, text) for name in names}
    else:
        stops = {address.name: partial(_stop, address, text) for address in engines()}
        if not stops and not every_engine:
            choose_engine(None)  # raises the error that no engine runs
    return _stop_at_once(stops)


def _stop_at_once(stops: Mapping[str, Callable[[], int]]) -> int:
    """Run the stops of all these engines or computers: one that does not answer, or has a wrong
    name, delays and prevents no other."""
    if len(stops) <= 1:
        return max((stop() for stop in stops.values()), default=0)

    def run(name: str) -> int:
        try:
            return stops[name]()
        except UserError as error:
            click.echo(f"{name}: {error}", err=True)
            return 1

    with ThreadPoolExecutor(len(stops)) as pool:
        return max(pool.map(run, stops))


def _stop_named(name: str, reason: str) -> int:
    from diffbotctl.control_socket.client import choose_engine

    return _stop(choose_engine(name), reason)


def _stop_far(at: str, engine: str | None, reason: str) -> int:
    """Stop the engine at `at`, all of them without a name, and report the result within 3 s."""
    from diffbotctl.control_socket.far_engine import SeveralEnginesError

    deadline = time.monotonic() + FAR_STOP_TIMEOUT_S
    try:
        failure = _stop_by_socket(engine, reason, deadline, at)
    except UnconfirmedStopError as error:
        failure = str(error)
    except SeveralEnginesError as several:
        return max(_stop_far(at, name, reason) for name in several.engines)
    except UserError as error:
        if isinstance(error, UsageError):
            raise
        failure = f"{error}\nNOT KNOWN whether the robot has stopped"
    if failure:
        click.echo(failure, err=True)
    return int(bool(failure))


def _stop(engine: EngineAddress, reason: str) -> int:
    try:
        failure = _stop_by_socket(engine.name, reason)
    except UnconfirmedStopError as error:
        click.echo(str(error), err=True)
        return 1
    except (UserError, OSError) as error:
        failure = str(error)
    if not failure:
        return 0
    click.echo(failure, err=True)
    if engine.process is None:
        click.echo("its process is unknown: switch the robot off", err=True)
        return 1
    return _stop_by_signal(engine.name, engine.process)


def _stop_by_socket(
    name: str | None, reason: str, deadline: float | None = None, at: str = ""
) -> str:
    """Request a stop and wait for it; returns what failed, or an empty text. Raises
    UnconfirmedStopError."""
    from diffbotctl.control_socket.address import engines

    with attached(name, "stop", deadline, at) as client:
        engine = str(client.about["engine"])
        name = f"{at}: {engine}" if at else engine
        client.request("stop", reason=reason[:REASON_MAX_CHARACTERS])
        status = settled(client, lambda status: _is_stopped(status) and _is_confirmed(status))
    if not _is_stopped(status):
        return f"{name}: accepted the stop, but still sends motion to the wheels"
    if not _is_confirmed(status):
        raise UnconfirmedStopError(
            f"{name}: held, but NOT CONFIRMED: the board does not answer, "
            f"{_link_text(status['robot.link'])}\n"
            "watch the wheels: its dead-man stops them; switch off a board that has none"
        )
    chosen = f" --engine {engine}" if not at and len(engines()) > 1 else ""
    click.echo(f"{name}: stopped; `diffbotctl resume{chosen}` allows motion again")
    return ""


def _is_stopped(status: dict[str, Any]) -> bool:
    held, wheels = status["gate.stop"], status["gate.wheels"]
    is_still = wheels is None or (wheels["left"] == 0 and wheels["right"] == 0)
    return is_still and held is not None and bool(held["code"])


def _is_confirmed(status: dict[str, Any]) -> bool:
    """Whether the board has answered since the stop; an engine of version 0.1 does not tell."""
    if "frame_time" not in status or status["gate.stop"] is None:
        return True
    link, frame = status["robot.link"], status["frame_time"]
    if link is None or frame is None:
        return False
    return bool(link["state"] == "up" and frame > status["gate.stop"]["time"])


def _link_text(link: dict[str, Any] | None) -> str:
    """The state of the link in words, with its cause."""
    if link is None:
        return "there is no link yet"
    return f"the link is {link['state']}" + (f" ({link['cause']})" if link["cause"] else "")


def _stop_by_signal(name: str, process: Process) -> int:
    for number, action in (
        (signal.SIGTERM, "sent SIGTERM"),
        (signal.SIGKILL, "killed; the board's dead-man or the watchdog process stops the motors"),
    ):
        click.echo(f"{name}: process {process.pid} is {action}", err=True)
        if not _send(process, number):
            click.echo(f"{name}: belongs to another user: switch the robot off", err=True)
            return 1
        if _has_ended(process):
            click.echo(f"{name}: ended")
            return 0
    click.echo(f"{name}: the process does not end: switch the robot off", err=True)
    return 1


def _send(process: Process, number: int) -> bool:
    """Send a signal; False when the process belongs to another user."""
    if not process.is_alive:
        return True
    try:
        os.kill(process.pid, number)
        os.kill(process.pid, signal.SIGCONT)  # a suspended engine must run to stop the robot
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    return True


def _has_ended(process: Process) -> bool:
    """Wait for the end of the process, at most EXIT_TIMEOUT_S."""
    deadline = time.monotonic() + EXIT_TIMEOUT_S
    while process.is_alive:
        if time.monotonic() > deadline:
            return False
        time.sleep(EXIT_POLL_PERIOD_S)
    return True


@command("Drive", 2, "; allow it to move again")
def resume(engine: str | None = ENGINE) -> int:
    """Allow the robot to move again after a stop that waits for a person. A waiting goal continues.

    Ends the stop in force now; later stops are not affected. When nothing is stopped and no goal
    waits, the command reports it and fails.
    """
    with attached(engine, "resume") as client:
        before = client.request("status")
        client.request("resume")
        if held_by(before):
            after = settled(client, lambda status: not held_by(status))
        elif has_waiting_goal(before):
            after = settled(client, lambda status: not has_waiting_goal(status))
        else:
            after = before
    success, text = resume_result(before, after)
    click.echo(text, err=not success)
    return 0 if success else 1


def has_waiting_goal(status: dict[str, Any]) -> bool:
    """Whether a goal was withdrawn while a person drove, and waits for `resume`."""
    goal = status["operator.goal"]
    return goal is not None and goal["number"] == 0


def resume_result(before: dict[str, Any], after: dict[str, Any]) -> tuple[bool, str]:
    """Whether `resume` ended anything, and the text to print: from the status before and after."""
    held_before, held_after = held_by(before), held_by(after)
    if held_after and (after["held"]["latched"] or held_after == held_before):
        return False, f"still stopped by {held_after}; {_remedy(after)}"
    effects = [f"released from {held_before}"] if held_before else []
    if has_waiting_goal(before) and not has_waiting_goal(after):
        effects.append(f"goal {after['operator.goal']['number']} continues")
    if held_after:
        effects.append(f"now stopped by {held_after}, which ends by itself")
    if effects:
        return True, "; ".join(effects)
    return False, f"nothing is stopped and no goal waits; {_goal_text(after)}"


def _remedy(status: dict[str, Any]) -> str:
    if not status["held"]["latched"]:
        return "the stop ends by itself when its cause is gone"
    link = status.get("robot.link")
    if link is not None and link["state"] != "up":
        return f"the link to the board is {link['state']}: call `resume` again when it is up"
    return "its cause is still there: `diffbotctl why` explains it"


def _goal_text(status: dict[str, Any]) -> str:
    from diffbotctl.messages import GoalState
    from diffbotctl.recording.json_codec import message_reader
    from diffbotctl.ui.run_text import goal_state_text

    record = status["goal_state"]
    if record is None:
        return "no goal is under way"
    state: GoalState = message_reader(GoalState)(record)
    return f"goal {state.number}: {goal_state_text(state)}"


@command("Look", 4, "; explain why one stopped")
def why(
    engine: str | None = ENGINE,
    all_causes: bool = option("--all", "Of a stop: from the sensor to the motors."),
    as_json: bool = JSON,
) -> None:
    """Explain why the robot last stopped, and what ends the stop.

    When no engine runs, explain the last run. --all needs its black box, which keeps the minutes
    before a stop.
    """
    explanation, held = _explanation_of(engine)
    print_row(
        as_json,
        {**explanation, "held": held},
        fold_text(explanation["text" if all_causes else "summary"]),
    )


def _explanation_of(engine: str | None) -> tuple[dict[str, str], dict[str, Any] | None]:
    """What `explain_stop` replies, and the stop in force; of the last run when no engine runs."""
    from diffbotctl.control_socket.address import engines
    from diffbotctl.recording.run_end import newest_flight
    from diffbotctl.replay.ended_run import explain_last_run

    if engine or host() or engines():
        ended = None
    else:
        if newest_flight() is not None and sys.stderr.isatty():
            click.echo("nothing is running: computing the last run again", err=True)
        ended = explain_last_run()
    if ended is not None:
        return ended._asdict(), None
    with attached(engine, "why") as client:
        explanation = client.request("explain_stop")
        held = client.request("status")["held"]
    return {name: explanation[name] for name in ("summary", "text")}, held
