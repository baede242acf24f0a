"""`diffbotctl run`: a pipeline on the simulated robot, or on a real one."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import command
from diffbotctl.cli.contradictions import exclusive, needs
from diffbotctl.cli.output import print_json
from diffbotctl.cli.program_consent import allowed_programs, with_code_consent
from diffbotctl.cli.run_arguments import (
    SCREENS,
    SOCKET_OPTIONS,
    RunArguments,
    check_fast,
    check_files,
    check_has_end,
    check_simulated,
    check_used,
    read_goal,
    read_log_level,
)
from diffbotctl.cli.screens import SavedTerminal, check_terminal, is_dumb_terminal, show
from diffbotctl.cli.standard_streams import NonBlockingStderr
from diffbotctl.cli.web import CLOSED, check_options, show_page
from diffbotctl.errors import UsageError
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.config.configuration import Configuration
    from diffbotctl.messages import Goal
    from diffbotctl.processes.screen import RunSnapshot
    from diffbotctl.runs.options import RunOptions, RunResult
    from diffbotctl.runs.run import Run
    from diffbotctl.runs.signals import Signals
    from diffbotctl.ui.saved_view import ViewSettings


@command("Run", 1, "Run a pipeline, real or simulated")
@exclusive("--dash", ("--web",), "both are screens: give one, and attach the other")
@exclusive("--json", SCREENS, "JSON is printed in place of a screen")
@exclusive("--quiet", SCREENS, "only the summary is printed in place of a screen")
@exclusive("--no-socket", SOCKET_OPTIONS, "without a control socket no client can connect")
@needs(("--lan", "--tcp-port"), ("--web",), "it is for the page")
@needs(("--force",), ("--record",), "it overwrites a recording")
def run(typed: RunArguments) -> int:
    """Run PIPELINE: a name (goal) or a file (./mine.yaml). Simulated unless --port names a board.

    Exit code: 0 all goals reached, 1 not all reached, the run failed, or its recording or log is
    incomplete, 2 wrong files or usage, 3 reached, but not surely or not exactly, 130 interrupted.
    """
    from diffbotctl.runs.signals import Signals, signals_as_interrupts

    typed = _with_port(click.get_current_context(), typed)
    view = None if typed.view_file is None else _read_view(typed.view_file)
    typed = typed._replace(dash=typed.dash or (view is not None and not typed.web))
    signals = Signals()  # from here on a signal is remembered, and ends the run when it has started
    from diffbotctl.runs.run import Run

    with signals_as_interrupts():  # code in a file may take long to import, or forever
        configuration, goals = _read(typed)
    run_options = _run_options(typed, configuration, goals)
    if typed.fast:
        check_has_end(configuration, run_options)
    if not typed.as_json:
        _print_header(configuration, typed.port, typed.seed)
    if configuration.robots and (typed.dash or typed.web):
        command = "dash" if typed.dash else "web"
        raise click.UsageError(
            f"--{command} shows one robot: start the run without it, then "
            f"`diffbotctl {command} --engine {next(iter(configuration.robots))}`"
        )
    if typed.dash:
        return run_with_dashboard(configuration, run_options, signals, view)
    if typed.web:
        page = show_page(typed.lan, typed.tcp_port, view)
        return _run_with_page(configuration, run_options, signals, page)
    stderr = NonBlockingStderr()
    is_silent = typed.quiet or typed.as_json
    show = None if is_silent else screen(configuration, typed.port, typed.duration)
    run = Run(configuration, run_options, show, stderr.say, signals)
    return _finish(run, stderr, typed.as_json)


def _with_port(context: click.Context, typed: RunArguments) -> RunArguments:
    """The arguments with the name of the port; refuses options that contradict each other."""
    check_fast(context)
    if typed.port != "auto":
        check_simulated(context, typed.port)
    check_files(typed.record, typed.force, typed.log)
    if typed.port == "auto":
        from diffbotctl.cli.choose_port import choose_port
        from diffbotctl.config.lookup import find_robot

        if typed.robot is not None:
            find_robot(typed.robot)  # a wrong name is refused before a port is searched for
        typed = typed._replace(port=choose_port(radio=True, simulates=True))
        check_simulated(context, typed.port)
    return typed


def _read(typed: RunArguments) -> tuple[Configuration, tuple[Goal, ...]]:
    """The checked configuration and the goals of --goal. Raises UserError; prints warnings."""
    from diffbotctl.config.checks.world import typed_goal_problems
    from diffbotctl.config.load import load
    from diffbotctl.drivers.robot_ports import VIRTUAL_PORTS, is_simulated_port

    goals = tuple(read_goal(text) for text in typed.goals)
    is_simulated = typed.port in VIRTUAL_PORTS

    def read() -> Configuration:
        return load(
            typed.pipeline,
            typed.robot,
            typed.sets,
            real=not is_simulated,
            refuse_simulated=not is_simulated_port(typed.port),
        )

    configuration = with_code_consent(read, typed.allow_programs)
    check_used(click.get_current_context(), configuration)
    problems = list(configuration.warnings)
    for text, goal in zip(typed.goals, goals, strict=True):
        place = f"--goal '{text}'"
        problems += typed_goal_problems(configuration, place, goal.x, goal.y, is_simulated)
    if any(problem.severity == "error" for problem in problems):
        raise UsageError(problems)
    for warning in problems:
        click.echo(warning.render(), err=True)
    return configuration, goals


def _run_options(
    typed: RunArguments, configuration: Configuration, goals: tuple[Goal, ...]
) -> RunOptions:
    from diffbotctl.recording.black_box_store import black_box_folder
    from diffbotctl.runs.options import RunOptions, SocketOptions

    is_unseen = typed.no_socket or (typed.fast and typed.name is None)  # it usually ends at once
    has_screen = typed.dash or typed.web
    return RunOptions(
        typed.port,
        goals,
        typed.seed,
        typed.fast,
        typed.duration,
        typed.record,
        typed.digest,
        socket=None if is_unseen else SocketOptions(typed.name, typed.group),
        stay=typed.stay or has_screen,
        dash=has_screen,
        log=typed.log,
        levels=tuple(read_log_level(text, configuration) for text in typed.levels),
        # A fast run can be repeated from its seed.
        flights=None if typed.fast else black_box_folder(),
        programs=None if typed.fast else allowed_programs(configuration, typed.allow_programs),
    )


def _read_view(path: Path) -> ViewSettings:
    from diffbotctl.ui.saved_view import read_view

    return read_view(str(path))


def run_with_dashboard(
    configuration: Configuration, options: RunOptions, signals: Signals, view: ViewSettings | None
) -> int:
    """The run with the dashboard as its screen; messages are printed when it is closed."""
    from diffbotctl.runs.run import Run

    check_terminal(options.socket is not None)
    terminal = SavedTerminal()
    screen = partial(show, view=view)
    run = Run(configuration, options, screen, terminal.words.append, signals, terminal.give_back)
    try:
        return _finish(run, NonBlockingStderr(), as_json=False)
    finally:
        terminal.end()
        for text in terminal.words:
            click.echo(text, err=True)


def _run_with_page(
    configuration: Configuration,
    options: RunOptions,
    signals: Signals,
    show: Callable[[Iterator[RunSnapshot]], None],
) -> int:
    """The run with the server of its page in place of a screen."""
    from diffbotctl.runs.run import Run

    check_options(options.socket is not None)
    stderr = NonBlockingStderr()
    run = Run(configuration, options, show, stderr.say, signals, partial(stderr.say, CLOSED))
    return _finish(run, stderr, as_json=False)


def _finish(run: Run, stderr: NonBlockingStderr, as_json: bool) -> int:
    """Run to the end and print the summary; returns the exit code."""
    from diffbotctl.recording.run_end import RunEnd, note_run_end

    began = time.time_ns()
    try:
        result = run.go()
    finally:
        stderr.end()
    stop = result.stops[-1] if result.stops else None
    note_run_end(RunEnd(str(run.configuration.file), began, result.ending.cause, stop))
    code = _result_code(result)
    if as_json:
        print_json(_result_record(result, code))
    else:
        from diffbotctl.ui.run_text import summary_lines

        verbose = click.get_current_context().params.get("verbose", False)
        for line in summary_lines(result, run.configuration.robot, verbose):
            click.echo(line)
    if result.failure is not None:
        raise result.failure
    return code


def _result_code(result: RunResult) -> int:
    """The exit code: 1 also for a robot that may still be moving, and for incomplete files."""
    from diffbotctl.messages import REACHED_UNSURE

    code = result.ending.code
    is_whole = result.recording is None and result.log is None
    if code in (0, REACHED_UNSURE) and (result.ending.stopped is False or not is_whole):
        return 1
    return code


def _result_record(result: RunResult, code: int) -> dict[str, Any]:
    from diffbotctl.ui.run_text import PoseErrors

    pose = result.odometry
    errors = PoseErrors.of(result)._asdict()
    return {
        "exit_code": code,
        "cause": result.ending.cause,
        "duration": result.ending.time / 1e9,
        "goals": result.goals,
        "reached": result.reached,
        "reached_unsure": result.unsure,
        "pose": None if pose is None else {"x": pose.x, "y": pose.y, "heading": pose.heading},
        **{name: error and error._asdict() for name, error in errors.items()},
        "path": result.path,
        "stops": [{"code": stop.code, "cause": stop.cause} for stop in result.stops],
        "stop_confirmed": result.ending.stopped,
        "incomplete_recording": result.recording,
        "incomplete_log": result.log,
        "digest": result.digest,
    }


def _print_header(configuration: Configuration, port: str, seed: int) -> None:
    from diffbotctl.drivers.robot_ports import VIRTUAL_PORTS

    kind = (
        f"{VIRTUAL_PORTS[port]} (seed {seed})" if port in VIRTUAL_PORTS else f"REAL robot on {port}"
    )
    robot = "" if configuration.robot_file is None else f" on robot {configuration.robot_file}"
    kind = kind if configuration.robot is not None or configuration.robots else "no robot"
    if configuration.robots:
        uses = [f"{name} ({use.robot_file})" for name, use in configuration.robots.items()]
        robot = f" with {len(uses)} robots, {', '.join(uses)}"
    click.echo(fold_text(f"{configuration.file}{robot}: {kind}", hang=2))
    for omission in configuration.all_omissions():
        click.echo(fold_text(f"  {omission.text()}", hang=4))
    if configuration.has_unverified_slots():
        click.echo("  counts not verified: `diffbotctl calibrate encoders` counts the slots")


def screen(
    configuration: Configuration, port: str, duration: float | None = None
) -> Callable[[Iterator[RunSnapshot]], None]:
    """The function that draws a run in a child process; only the child imports the drawing.

    `duration`: time limit in s of logical time, for its progress.
    """

    def show(snapshots: Iterator[RunSnapshot]) -> None:
        if configuration.robots or not sys.stdout.isatty() or is_dumb_terminal():
            from diffbotctl.ui import run_text

            run_text.print_log(snapshots)
            return
        from diffbotctl.render.map_scene import describe_scene, parse_scene
        from diffbotctl.ui import live_view

        scene = parse_scene(describe_scene(configuration, None, port))
        live_view.show_live(scene, snapshots, duration)

    return partial(show)
