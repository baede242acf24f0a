"""`diffbotctl replay`: run a recording again, unchanged or with other parameters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl import __version__
from diffbotctl.cli.command import command, option
from diffbotctl.cli.contradictions import check_span, exclusive, needs
from diffbotctl.cli.options import FORCE, JSON, SETS, quantity_option
from diffbotctl.cli.output import check_overwrite, print_json, problem_record
from diffbotctl.time import NEVER, SECOND

if TYPE_CHECKING:
    from diffbotctl.replay.recorded_run import RecordedRun
    from diffbotctl.replay.replay import ReplayOptions, ReplayResult, Show


@command("Record", 1, "Replay a recording")
@exclusive("--check", ("--set", "--from", "--until"), "it compares the whole, unchanged recording")
@exclusive("--json", ("--dash", "--rate"), "JSON is printed in place of a screen")
@needs(("--same-motion",), ("--set",), "an unchanged replay always has the recorded motion")
@needs(("--force",), ("--record",), "it overwrites a recording")
def replay(
    file: Path,
    check: bool = option("Compare every message with the recorded one."),
    rate: float | None = option(
        "X times real time, with a view; default: as fast as possible, without one.",
        type=click.FloatRange(0.01, 1000.0),
        metavar="X",
    ),
    dash: bool = option("Show the dashboard, in real time or at --rate."),
    begin: float | None = quantity_option("s", "--from", "Show and measure from this time."),
    until: float | None = quantity_option("s", "End at this time."),
    sets: tuple[str, ...] = SETS,
    same_motion: bool = option("With --set: always use the recorded motion."),
    record: Path | None = option("Record the replay: FILE.mcap."),
    force: bool = FORCE,
    as_json: bool = JSON,
) -> int:
    """Replay the recording FILE: drivers deliver the recorded messages, blocks react to them.

    With --set, a simulated robot drives again and reacts to the changes; any other robot moves as
    recorded. The metrics are printed beside those of the recording.

    Exit code: 0 replayed and the same, 1 different, unreadable, or ended by an error, such as a
    block that raised.
    """
    from diffbotctl.replay import recorded_run
    from diffbotctl.replay.replay import ReplayOptions, replay_run

    check_span(begin, until)
    _check_record(file, record, force)
    run = recorded_run.read_run(file)
    if "code" in run.about:
        _require_code(run)
    if begin is not None and begin * SECOND > run.last:
        end = f"the last message is at {run.last / SECOND:.2f} s"
        raise click.UsageError(f"--from {begin:g} s has nothing to show: {end}")
    if dash:
        from diffbotctl.cli.screens import SavedTerminal, check_terminal

        check_terminal(has_socket=True)
        click.get_current_context().call_on_close(SavedTerminal().end)
        rate = rate or 1.0
    options = ReplayOptions(
        check,
        rate,
        0 if begin is None else round(begin * SECOND),
        NEVER if until is None else round(until * SECOND),
        sets,
        record,
        None if rate is None else _view(run, dash),
        dash,
    )
    if as_json:
        result = _replay_changed(run, options, same_motion) if sets else replay_run(run, options)
        _print_json_result(run, result)
        return _code(result)
    if not check:
        _print_begin(run)
    if sets:
        _print_motion(run, same_motion)
        result = _replay_changed(run, options, same_motion)
    else:
        result = replay_run(run, options)
    _print_result(result)
    if result.difference is None:
        _print_metrics(run, options, result)
    return _code(result)


def _code(result: ReplayResult) -> int:
    """The exit code. Raises RunError for what ended the replay, which is then printed."""
    if result.failure is not None:
        raise result.failure
    return int(result.difference is not None)


def _require_code(run: RecordedRun) -> None:
    """Ask for the consent to code in files. Raises ConfigurationError, also if one is missing."""
    from diffbotctl.cli.program_consent import with_code_consent
    from diffbotctl.replay.recorded_run import recorded_configuration

    def read() -> None:
        with recorded_configuration(run.path, run.about):
            pass

    with_code_consent(read)


def _check_record(file: Path, record: Path | None, force: bool) -> None:
    if record is None:
        return
    if record.exists() and record.samefile(file):
        raise click.UsageError("--record must not overwrite the recording that is replayed")
    check_overwrite(record, force)


def _motion_reason(run: RecordedRun, same_motion: bool) -> str | None:
    """Why the recorded motion is used; None when the simulated robot drives again."""
    from diffbotctl.replay.resimulate import why_not_resimulable

    return "as requested" if same_motion else why_not_resimulable(run)


def _print_motion(run: RecordedRun, same_motion: bool) -> None:
    reason = _motion_reason(run, same_motion)
    if reason is None:
        click.echo("the simulated robot drives again and reacts to the changes")
    else:
        click.echo(f"with the recorded motion ({reason})")


def _replay_changed(run: RecordedRun, options: ReplayOptions, same_motion: bool) -> ReplayResult:
    from diffbotctl.replay.replay import replay_run
    from diffbotctl.replay.resimulate import resimulate

    if _motion_reason(run, same_motion) is None:
        return resimulate(run, options)
    return replay_run(run, options)


def _print_json_result(run: RecordedRun, result: ReplayResult) -> None:
    first, failure = result.difference, result.failure
    print_json(
        {
            "version": result.version,
            "duration": result.ending.time / SECOND,
            "digest": result.digest,
            "compared": result.compared,
            "text_differences": result.text_differences,
            "left_out": dict(result.left_out),
            "difference": None if first is None else first._asdict(),
            "failure": None if failure is None else problem_record(failure.problems[0]),
            "cut": run.is_cut,
        }
    )


def _print_result(result: ReplayResult) -> None:
    """Print how the replay went, and where it differs from the recording."""
    from diffbotctl import __version__

    if result.version != __version__:
        click.echo(f"recorded with version {result.version}, replayed with {__version__}")
    early = "" if result.failure is None else f", then it ended: {result.ending.cause}"
    click.echo(f"replayed {result.ending.time / SECOND:.2f} s{early}")
    click.echo(f"digest {result.digest}")
    if result.difference is not None:
        first = result.difference
        click.echo(f"DIFFERENT at {first.time / SECOND:.6f} s on {first.wire}")
        click.echo(f"  recorded {first.recorded}")
        click.echo(f"  replayed {first.replayed}")
        return
    for wire, count in result.left_out.items():
        click.echo(f"not compared: {count} messages on {wire}, a wire the recording does not have")
    if result.text_differences:
        click.echo(
            f"{result.text_differences} log lines or causes are worded differently in version "
            f"{result.version}; everything else in them is the same"
        )
    if result.compared:
        click.echo(f"same: {result.compared} messages compared, bit for bit")


def _print_metrics(run: RecordedRun, options: ReplayOptions, result: ReplayResult) -> None:
    """The metrics of the replay beside those of the recording, when they can differ."""
    from diffbotctl.recording.metrics import recorded_metrics
    from diffbotctl.replay.replay import replay_run
    from diffbotctl.ui import recording_text

    if not options.sets and not options.begin and options.until == NEVER:
        for line in recording_text.metrics_lines(result.metrics):
            click.echo(line)
        return
    if run.is_black_box:  # it holds no poses: they are computed again, without the changes
        before = replay_run(
            run, options._replace(sets=(), record=None, speed=None, show=None)
        ).metrics
    else:
        until = options.until if options.until < NEVER else None
        before = recorded_metrics(run.path, options.begin, until)
    click.echo()
    for line in recording_text.metrics_table(before, result.metrics, ("recorded", "replayed")):
        click.echo(line)


def _print_begin(run: RecordedRun) -> None:
    if run.is_cut:
        click.echo(f"the recording is incomplete: it was cut at {run.last / SECOND:.2f} s")
    if run.begins == "state" and run.state is not None:
        click.echo(f"starts {run.state[0] / SECOND:.2f} s after the run's start, in a saved state")
    elif run.begins != "run":
        reason = run.about.get("state_problem") or "the beginning of the run was not kept"
        if run.state_version is not None:
            reason = f"version {run.state_version} saved it, this is version {__version__}"
        click.echo(f"starts in an unknown state: {reason}.")
        click.echo("Poses count from there, and earlier goals and stops are unknown")


def _view(run: RecordedRun, dash: bool) -> Show:
    """What `run` draws: a map on a terminal, else a line for each event; or the dashboard."""
    if dash:
        from diffbotctl.cli.screens import show

        return show
    from diffbotctl.cli.run import screen
    from diffbotctl.replay import recorded_run

    with recorded_run.recorded_configuration(run.path, run.about) as configuration:
        return screen(configuration, run.about["port"])
