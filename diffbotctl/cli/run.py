"""`diffbotctl run`: a pipeline on the simulated robot, or on a real one."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.nonblocking_stderr import NonBlockingStderr

if TYPE_CHECKING:
    from diffbotctl.config.configuration import Configuration
    from diffbotctl.messages import Goal
    from diffbotctl.processes.screen import RunSnapshot
    from diffbotctl.runs.control_socket import SocketOptions
    from diffbotctl.runs.run import Run, RunOptions


@click.command()
@click.argument("pipeline")
@click.option("--robot", help="Robot file or name; wins over the pipeline's own.")
@click.option(
    "--port",
    default="sim",
    show_default=True,
    help="sim, emulated, auto, a serial device, or bluetooth:ADDRESS.",
)
@click.option(
    "--goal",
    "goals",
    multiple=True,
    metavar="'X Y [HEADING]'",
    help="A goal such as '1.0 0.5 90deg', in place of the file's. Repeatable.",
)
@click.option(
    "--set",
    "sets",
    multiple=True,
    metavar="BLOCK.PARAM=VALUE",
    help="Change one value of the files. Repeatable.",
)
@click.option("--seed", default=0, show_default=True, help="Draws the simulated robot.")
@click.option("--fast", is_flag=True, help="Simulate as fast as the machine can.")
@click.option("--for", "duration", metavar="TIME", help="End after so long, such as 30s.")
@click.option(
    "--record", type=click.Path(dir_okay=False, path_type=Path), help="Write an MCAP file."
)
@click.option(
    "--log",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Add every event to a file, one JSON object a line.",
)
@click.option(
    "--log-level",
    "levels",
    multiple=True,
    metavar="[BLOCK=]LEVEL",
    help="Hear a block, or all, from debug, info, warning or error on. Repeatable.",
)
@click.option("--digest", is_flag=True, help="Print one hash over every message of the run.")
@click.option("--stay", is_flag=True, help="Go on after the last goal: a person gives the next.")
@click.option("--dash", is_flag=True, help="Show the dashboard; leaving it ends the run.")
@click.option("--name", help="What `--engine` calls this run; without it the pipeline's name.")
@click.option("--group", help="Let the members of this group command it, from /run.")
@click.option("--no-socket", is_flag=True, help="Nobody can watch or command this run.")
@click.option("--quiet", is_flag=True, help="No live view and no lines while it runs.")
def command(
    pipeline: str,
    robot: str | None,
    port: str,
    goals: tuple[str, ...],
    sets: tuple[str, ...],
    seed: int,
    fast: bool,
    duration: str | None,
    record: Path | None,
    digest: bool,
    stay: bool,
    dash: bool,
    name: str | None,
    group: str | None,
    no_socket: bool,
    quiet: bool,
    log: Path | None,
    levels: tuple[str, ...],
) -> int:
    """Run PIPELINE: a name (goal), or a file (./mine.yaml). Simulated unless --port says otherwise.

    Exit code: 0 all goals reached, 1 it ran and failed, 2 wrong files or usage, 130 interrupted.
    """
    from diffbotctl.config.load import load
    from diffbotctl.drivers.robot_link import VIRTUAL_PORTS
    from diffbotctl.recording.black_box_store import black_box_folder
    from diffbotctl.runs.run import Run, RunOptions
    from diffbotctl.runs.signals import Signals

    if port == "auto":
        from diffbotctl.cli.choose_port import choose_port

        port = choose_port(radio=True)
    wanted = tuple(_goal(text) for text in goals)
    seconds = None if duration is None else _quantity(duration, "s", "--for")
    configuration = load(pipeline, robot, sets, real=port not in VIRTUAL_PORTS)
    for warning in configuration.warnings:
        click.echo(warning.render(), err=True)
    _announce(configuration, port, seed)
    heard = tuple(_level(text, configuration) for text in levels)
    fast = fast and port in VIRTUAL_PORTS
    socket = None if no_socket or fast else _socket(name, group)  # a fast run is over at once
    stay = stay or dash
    flights = None if fast else black_box_folder()  # a fast run is the same again from its seed
    options = RunOptions(
        port, wanted, seed, fast, seconds, record, digest, socket, stay, dash, log, heard, flights
    )
    if dash:
        return _with_dashboard(configuration, options)
    aside = NonBlockingStderr()
    picture = None if quiet else screen(configuration, port)
    run = Run(configuration, options, picture, aside.say, Signals())
    return _finish(run, aside)


def _socket(name: str | None, group: str | None) -> SocketOptions:
    from diffbotctl.runs.control_socket import SocketOptions

    return SocketOptions(name, group)


def _with_dashboard(configuration: Configuration, options: RunOptions) -> int:
    """The run, with the dashboard as its screen; what it has to say waits until that is left."""
    from diffbotctl.cli.run_dash import SavedTerminal, check_terminal, show
    from diffbotctl.runs.run import Run
    from diffbotctl.runs.signals import Signals

    check_terminal(options.socket is not None)
    held = SavedTerminal()
    run = Run(configuration, options, show, held.words.append, Signals(), held.give_back)
    code = _finish(run, NonBlockingStderr())
    for text in held.words:
        click.echo(text, err=True)
    return code


def _finish(run: Run, aside: NonBlockingStderr) -> int:
    try:
        result = run.go()
    finally:
        aside.end()
    from diffbotctl.ui.run_text import summary_lines

    for line in summary_lines(result, run.operator.last):
        click.echo(line)
    if result.failure is not None:
        raise result.failure
    unproven = result.ending.stopped is False  # it may still be moving: that is no success
    return result.ending.code or int(unproven)


def _announce(configuration: Configuration, port: str, seed: int) -> None:
    from diffbotctl.drivers.robot_link import VIRTUAL_PORTS
    from diffbotctl.ui.text import fold_text

    where = f"REAL robot on {port}"
    if port in VIRTUAL_PORTS:
        where = f"{VIRTUAL_PORTS[port]} (seed {seed})"
    name = "" if configuration.robot_file is None else f" on robot {configuration.robot_file}"
    where = where if configuration.robot is not None else "no robot"
    click.echo(fold_text(f"{configuration.file}{name}: {where}", hang=2))


def screen(configuration: Configuration, port: str) -> Callable[[Iterator[RunSnapshot]], None]:
    """What draws a run: in a child process, which alone imports the drawing."""

    def show(pictures: Iterator[RunSnapshot]) -> None:
        if not sys.stdout.isatty():
            from diffbotctl.ui import run_text

            run_text.print_log(pictures)
            return
        from diffbotctl.render.map_scene import scene, scene_of
        from diffbotctl.ui import live_view

        live_view.show_live(scene_of(scene(configuration, None, port)), pictures)

    return partial(show)


def _level(text: str, configuration: Configuration) -> tuple[str, str]:
    """A source of the log and the level it is heard from: `guard=debug`, or `debug` for all."""
    from diffbotctl.config.node_ports import RESERVED
    from diffbotctl.errors import closest_match
    from diffbotctl.log import ALL
    from diffbotctl.messages import LOG_LEVELS

    source, _, level = text.rpartition("=")
    known = [use.name for use in configuration.blocks] + [n for n in RESERVED if n != "log"]
    if level not in LOG_LEVELS:
        raise click.UsageError(f"--log-level {text}: there are {', '.join(LOG_LEVELS)}")
    if source and source not in known:
        near = closest_match(source, known) or ", ".join(known)
        raise click.UsageError(f"--log-level: there is no block '{source}'; did you mean {near}?")
    return source or ALL, level


def _goal(text: str) -> Goal:
    from diffbotctl.messages import Goal

    parts = text.replace(",", " ").split()
    if not 2 <= len(parts) <= 3:
        raise click.UsageError(
            f"--goal '{text}': give X Y and, if you like, a heading: '1.0 0.5 90deg'"
        )
    x, y = (_quantity(part, "m", "--goal") for part in parts[:2])
    heading = _quantity(parts[2], "rad", "--goal") if len(parts) == 3 else None
    return Goal(0, 0, x, y, heading)


def _quantity(text: str, unit: str, option: str) -> float:
    from math import isfinite

    from diffbotctl.units import UnitError, quantity

    try:
        value = quantity(text, unit)
    except UnitError as error:
        raise click.UsageError(f"{option}: {error}") from error
    if not isfinite(value) or (unit == "s" and value <= 0):
        raise click.UsageError(f"{option}: {text} makes no sense here")
    return value
