"""`diffbotctl replay`: run a recording again, as it was or with something changed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.time import SECOND

if TYPE_CHECKING:
    from diffbotctl.replay.recorded_run import RecordedRun
    from diffbotctl.replay.replay import ReplayOptions, ReplayResult, Show


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--check", is_flag=True, help="Compare every message with the recorded one.")
@click.option(
    "--speed",
    type=click.FloatRange(0.01, 1000.0),
    metavar="X",
    help="X times real time, with a view; without it as fast as it goes.",
)
@click.option("--dash", is_flag=True, help="Show it in the dashboard, at real time or --speed.")
@click.option("--from", "begin", metavar="TIME", help="Show and measure from there, such as 3s.")
@click.option("--until", metavar="TIME", help="End there.")
@click.option(
    "--set",
    "sets",
    multiple=True,
    metavar="BLOCK.PARAM=VALUE",
    help="Change one value of the recorded files. Repeatable.",
)
@click.option("--same-motion", is_flag=True, help="With --set: the recorded motion, in any case.")
@click.option(
    "--record", type=click.Path(dir_okay=False, path_type=Path), help="Write what came of it."
)
def command(
    file: Path,
    check: bool,
    speed: float | None,
    dash: bool,
    begin: str | None,
    until: str | None,
    sets: tuple[str, ...],
    same_motion: bool,
    record: Path | None,
) -> int:
    """Replay the recording FILE: the drivers' messages come from it, the blocks react anew.

    With --set, a simulated robot drives once more and answers to what was changed; any other robot
    moves as recorded. What changed is printed beside the recording.

    Exit code: 0 the same, 1 different or unreadable.
    """
    from diffbotctl.replay import recorded_run
    from diffbotctl.replay.replay import ReplayOptions, replay_run
    from diffbotctl.time import NEVER

    if check and (sets or begin or until):
        raise click.UsageError("--check compares the whole recording as it is: nothing else fits")
    if record is not None and record.exists() and record.samefile(file):
        raise click.UsageError("--record must not write over the recording that is replayed")
    run = recorded_run.read_run(file)
    if dash:
        from diffbotctl.cli.run_dash import check_terminal

        check_terminal(has_socket=True)
        speed = speed or 1.0
    wanted = ReplayOptions(
        check,
        speed,
        _time(begin, "--from", 0),
        _time(until, "--until", NEVER),
        sets,
        record,
        None if speed is None else _view(run, dash),
        dash,
    )
    _say_where_it_begins(run)
    if not sets:
        done = replay_run(run, wanted)
        return _told(done) or _measured(run, wanted, done)
    return _measured(run, wanted, _changed(run, wanted, same_motion))


def _changed(run: RecordedRun, wanted: ReplayOptions, same_motion: bool) -> ReplayResult:
    from diffbotctl.replay.replay import replay_run
    from diffbotctl.replay.resimulate import resimulate, why_not_resimulable

    reason = "asked for" if same_motion else why_not_resimulable(run)
    if reason is None:
        click.echo("the simulated robot drives once more, and answers to what was changed")
        done = resimulate(run, wanted)
    else:
        click.echo(f"the recorded motion ({reason})")
        done = replay_run(run, wanted)
    _told(done)
    return done


def _told(done: ReplayResult) -> int:
    """Say how the replay went; 1 when it differs from what it was compared with."""
    from diffbotctl import __version__

    if done.version != __version__:
        click.echo(f"recorded with version {done.version}, replayed with {__version__}")
    click.echo(f"replayed {done.ending.time / 1e9:.2f} s")
    click.echo(f"digest {done.digest}")
    if done.difference is not None:
        first = done.difference
        click.echo(f"DIFFERENT at {first.time / 1e9:.6f} s on {first.wire}")
        click.echo(f"  recorded {first.recorded}")
        click.echo(f"  replayed {first.replayed}")
        return 1
    for wire, count in done.left_out.items():
        click.echo(f"not compared: {count} messages on {wire}, a wire that the recording lacks")
    if done.text_differences:
        click.echo(
            f"version {done.version} worded {done.text_differences} log lines or causes "
            "differently; all else in them is the same"
        )
    if done.compared:
        click.echo(f"same: {done.compared} messages compared, bit for bit")
    return 0


def _measured(run: RecordedRun, wanted: ReplayOptions, done: ReplayResult) -> int:
    """The metrics of the replay beside those of the recording, where they can differ."""
    from diffbotctl.recording.metrics import recorded_metrics
    from diffbotctl.replay.replay import replay_run
    from diffbotctl.time import NEVER
    from diffbotctl.ui import recording_text

    if not wanted.sets and not wanted.begin and wanted.until == NEVER:
        return 0
    if run.is_black_box:  # it holds no poses: they are made anew, without the changes
        before = replay_run(
            run, wanted._replace(sets=(), record=None, speed=None, show=None)
        ).metrics
    else:
        until = wanted.until if wanted.until < NEVER else None
        before = recorded_metrics(run.path, wanted.begin, until)
    click.echo()
    for line in recording_text.metrics_table(before, done.metrics, ("recorded", "replayed")):
        click.echo(line)
    return 0


def _say_where_it_begins(run: RecordedRun) -> None:
    if run.begins == "state" and run.state is not None:
        click.echo(f"begins {run.state[0] / SECOND:.2f} s after the start, in a known state")
    elif run.begins != "run":
        click.echo("begins in a state unknown: the recorder had lost the run's beginning, so that")
        click.echo("poses count from there and nothing is known of goals and stops before it")


def _time(text: str | None, option: str, default: int) -> int:
    from diffbotctl.cli.engine_client import quantity_of

    return default if text is None else round(quantity_of(text, "s", option) * SECOND)


def _view(run: RecordedRun, dash: bool) -> Show:
    """What `run` draws: a map on a terminal, else one line an event; or the dashboard."""
    if dash:
        from diffbotctl.cli.run_dash import show

        return show
    from diffbotctl.cli.run import screen
    from diffbotctl.replay import recorded_run

    with recorded_run.recorded_configuration(run) as configuration:
        return screen(configuration, run.about["port"])
