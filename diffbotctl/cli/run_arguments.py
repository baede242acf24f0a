"""Checks of the options of `run` that depend on each other, and the reading of its texts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from diffbotctl.cli.command import option
from diffbotctl.cli.contradictions import is_typed, refuse_pair
from diffbotctl.cli.options import (
    FOR,
    FORCE,
    JSON,
    ROBOT,
    SEED,
    SETS,
    VIEW,
    VIRTUAL_PORTS,
    port_option,
)
from diffbotctl.cli.output import check_overwrite, refuse_special_file
from diffbotctl.cli.web import LAN, PAGE_PORT
from diffbotctl.errors import Problem, UsageError, closest_match

if TYPE_CHECKING:
    from diffbotctl.config.configuration import Configuration
    from diffbotctl.messages import Goal
    from diffbotctl.runs.options import RunOptions

GOAL_WIRE = "operator.goal"
SCREENS = ("--dash", "--web", "--view")
SOCKET_OPTIONS = (*SCREENS, "--name", "--group")  # they need a control socket


class RunArguments(NamedTuple):
    """What was typed."""

    pipeline: str
    robot: str | None = ROBOT
    port: str = port_option("sim")
    goals: tuple[str, ...] = option(
        "--goal",
        "A goal such as '1.0 0.5 90deg', instead of the file's goals. Repeatable.",
        metavar="'X Y [HEADING]'",
    )
    sets: tuple[str, ...] = SETS
    seed: int = SEED
    fast: bool = option("Simulate as fast as possible.")
    duration: float | None = FOR
    record: Path | None = option("Record the run: FILE.mcap.")
    force: bool = FORCE
    log: Path | None = option("Append every event to FILE as JSON lines.")
    levels: tuple[str, ...] = option(
        "--log-level",
        "Log level of a block, or of all: debug, info, warning or error. Repeatable.",
        metavar="[BLOCK=]LEVEL",
    )
    digest: bool = option("Print a hash over every message of the run.")
    stay: bool = option("Wait for more goals after the last one.")
    dash: bool = option("Show the dashboard; closing it ends the run.")
    web: bool = option("Serve the page of the run to browsers and phones.")
    lan: bool = LAN
    tcp_port: int = PAGE_PORT
    view_file: Path | None = VIEW
    name: str | None = option(
        "Name of this engine for `--engine`; default: the pipeline's name. With --fast there is a "
        "control socket only if it is given."
    )
    group: str | None = option("Allow members of this group to command it, through /run.")
    no_socket: bool = option("No control socket: no client can connect.")
    allow_programs: bool = option("Run the pipeline's programs and files of code, unasked.")
    quiet: bool = option("Print the summary only.")
    verbose: bool = option("Print the errors as estimated in the summary too.")
    as_json: bool = JSON


def check_fast(context: click.Context) -> None:
    """Raises click.UsageError for a --fast run without a socket that an option needs."""
    if not is_typed(context, "--fast") or is_typed(context, "--name"):
        return
    for typed in SOCKET_OPTIONS:
        if is_typed(context, typed):
            reason = "a --fast run has no control socket unless --name is given"
            refuse_pair(typed, "--fast", reason)


def check_simulated(context: click.Context, port: str) -> None:
    """Raises click.UsageError for options of a simulated run where `port` is a real one."""
    if port in VIRTUAL_PORTS:
        return
    for typed, reason in (
        ("--fast", "a real robot moves in real time"),
        ("--seed", "the random numbers are those of the simulated robot"),
    ):
        if is_typed(context, typed):
            refuse_pair(typed, f"--port {port}", reason)


def check_used(context: click.Context, configuration: Configuration) -> None:
    """Raises click.UsageError for options that this pipeline has no use for."""
    if configuration.robots:
        return
    if configuration.robot is None:
        for typed in ("--robot", "--port", "--seed"):
            if is_typed(context, typed):
                raise click.UsageError(f"{typed} has no effect: this pipeline has no robot")
    wires = [use.wires for use in configuration.blocks]
    wires += [use.wires for use in configuration.programs]
    takes_goals = any(GOAL_WIRE in own.values() for own in wires)
    if is_typed(context, "--goal") and not takes_goals:
        raise click.UsageError("--goal has no effect: no block of this pipeline follows goals")


def check_files(record: Path | None, force: bool, log: Path | None) -> None:
    """Raises UsageError for files that the run must not write.

    A log is appended to its file, which then must be a log of a run.
    """
    if record is not None:
        check_overwrite(record, force)
    if log is None:
        return
    if record is not None and _is_same(record, log):
        cause = "--record and --log name the same file"
        raise UsageError(Problem("E-LOG", str(log), cause, "give two files"))
    refuse_special_file(log)
    try:
        with log.open("rb") as file:
            start = file.read(1) if log.is_file() else b""
    except OSError:
        return  # a new file; one that cannot be written is reported when it is opened
    if start not in (b"", b"{"):
        cause = "this file is not the log of a run, which would be appended to it"
        raise UsageError(Problem("E-LOG", str(log), cause, "choose another name"))


def _is_same(one: Path, other: Path) -> bool:
    return one.resolve() == other.resolve() or (
        one.is_file() and other.is_file() and one.samefile(other)
    )


def check_has_end(configuration: Configuration, options: RunOptions) -> None:
    """Raises UsageError for a --fast run that nothing would end.

    It ends after its last goal or its time; a client could end it, too, or send a goal.
    """
    if options.duration is not None or options.socket is not None:
        return
    parts = list(configuration.robots.values()) or [configuration]
    has_goals = bool(options.goals) or any(part.goals for part in parts)
    if has_goals and not options.stay:
        return
    if options.stay:
        cause = "--stay waits for goals, and a --fast run without --name has no socket for them"
        fix = "leave out --stay or --fast, or limit the time: --for 60s"
    else:
        cause = "this pipeline has no goals, so that a --fast run of it would never end"
        fix = "limit its time: --for 60s; or leave out --fast and send it commands"
    raise UsageError(Problem("E-ENDLESS", "--fast", cause, fix))


def read_log_level(text: str, configuration: Configuration) -> tuple[str, str]:
    """Source and level from `guard=debug`, or `debug` for all sources.

    Raises click.UsageError.
    """
    from diffbotctl.config.node_ports import RESERVED
    from diffbotctl.log import ALL
    from diffbotctl.messages import LOG_LEVELS

    source, _, level = text.rpartition("=")
    parts = {f"{name}.": part for name, part in configuration.robots.items()} or {"": configuration}
    sources = [f"{name}{use.name}" for name, part in parts.items() for use in part.blocks]
    sources += [f"{name}{node}" for name in parts for node in RESERVED if node != "log"]
    if level not in LOG_LEVELS:
        raise click.UsageError(f"--log-level {text}: the levels are {', '.join(LOG_LEVELS)}")
    if source and source not in sources:
        near = closest_match(source, sources) or ", ".join(sources)
        raise click.UsageError(f"--log-level: there is no block '{source}'; did you mean {near}?")
    return source or ALL, level


def read_goal(text: str) -> Goal:
    """A goal from `1.0 0.5 90deg`. Raises click.UsageError."""
    from diffbotctl.messages import Goal
    from diffbotctl.units import UnitError, parse_pose

    try:
        x, y, heading = parse_pose(text)
    except UnitError as error:
        raise click.UsageError(f"--goal '{text}': {error}") from error
    return Goal(0, 0, x, y, heading)
