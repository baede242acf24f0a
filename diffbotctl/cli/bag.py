"""`diffbotctl bag`: make and inspect recordings."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from shutil import get_terminal_size
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.bag_live import record, save
from diffbotctl.cli.bag_play import play
from diffbotctl.cli.command import ANY_PATH, argument, group, option
from diffbotctl.cli.contradictions import check_span, exclusive, needs
from diffbotctl.cli.options import FORCE, JSON, choice_option, quantity_option
from diffbotctl.cli.output import CSV_MARK, check_overwrite, open_output, print_json, write_output
from diffbotctl.errors import Problem, UsageError
from diffbotctl.printable import PrintableStream, RawStream, keep_lines
from diffbotctl.time import NEVER, SECOND

if TYPE_CHECKING:
    from diffbotctl.recording.fields import Series
    from diffbotctl.recording.reader import RecordingInfo
    from diffbotctl.ros2.bag_export import ExportResult


@group("Record", 3, "Recordings: record, save, info, plot, export, diff")
def bag() -> None:
    """Record a running engine, play into one; inspect recordings: content, plots, differences."""


bag.add_command(record)
bag.add_command(save)
bag.add_command(play)


@bag.command()
def info(file: Path, as_json: bool = JSON) -> None:
    """Show what is in the recording FILE, why its run ended, and whether it is complete."""
    from diffbotctl.recording.reader import recording_info
    from diffbotctl.ui import recording_text

    record = recording_info(file)
    if as_json:
        print_json(_info_record(record))
        return
    for line in recording_text.info_lines(record):
        click.echo(line)


def _info_record(info: RecordingInfo) -> dict[str, Any]:
    return {
        "file": str(info.path),
        "bytes": info.size,
        "complete": info.complete,
        "cut": info.cut,
        "duration": (info.ends - info.begins) / SECOND,
        "run": info.about,
        "end": info.end,
        "attachments": list(info.attachments),
        "topics": [topic._asdict() for topic in info.topics],
    }


@bag.command()
def recover(
    file: Path,
    output: Path | None = option("The recovered file; default: FILE-recovered beside FILE."),
    force: bool = FORCE,
) -> None:
    """Write what can be read of the damaged or unfinished recording FILE as a complete file."""
    from diffbotctl.recording.recover import recover

    target = output or file.with_stem(f"{file.stem}-recovered")
    if target.exists() and target.samefile(file):
        raise click.UsageError("--output must not overwrite the recording that is recovered")
    check_overwrite(target, force)
    result = recover(file, target)
    click.echo(f"{target}: {result.messages} messages")
    if result.damaged:
        click.echo(f"{result.damaged} damaged chunks could not be read; their messages are missing")
    if result.cut is not None:
        click.echo(f"the recording was cut ({result.cut})")


def _write_attachment(file: Path, name: str, output: Path | None, force: bool) -> int:
    from diffbotctl.recording.reader import read_attachment

    text = read_attachment(file, name).decode("utf-8", "replace")
    if output is None:
        click.echo(text)
        return 0
    with open_output(output, [Path(name).suffix], force) as target:
        target.write(text)
    return 0


@bag.command()
@exclusive("--attachment", ("FIELD", "--format", "--robot"), "an attached file is written as it is")
@needs(("--force",), ("--output",), "it overwrites a file")
def export(
    file: Path,
    fields: tuple[str, ...] = argument("[FIELD]..."),
    attachment: str | None = option("Write this attached file: layout.json.", metavar="NAME"),
    kind: str = choice_option(("csv", "rosbag2"), "--format", "A table, or a folder for ROS 2."),
    output: Path | None = option(
        "Write FILE.csv instead of standard output; the folder of a rosbag2.",
        type=ANY_PATH,
    ),
    force: bool = FORCE,
    robot: str | None = option(
        "rosbag2: robot file in place of the recorded one.", metavar="ROBOT"
    ),
) -> int:
    """Write the FIELDs of the recording FILE as CSV: odometry.odometry.x, or a whole topic.

    One row for each instant with a value; a field without a value then is empty. Times are seconds
    since the start of the run. Without FIELD everything is written. The last column of a file is
    empty; its name, diffbotctl, marks the file as one that a later export may overwrite.
    With --attachment, an attached file is written instead: robot.urdf, or layout.json.

    A rosbag2 has the topics of `diffbotctl ros2`, and /cmd_vel: `ros2 bag play FOLDER`.
    """
    if fields and not file.exists() and Path(fields[-1]).is_file():  # as `bag plot` has it
        file, fields = Path(fields[-1]), (str(file), *fields[:-1])
    if kind != "rosbag2" and robot is not None:
        raise click.UsageError(
            "--robot has no effect without --format rosbag2: a table has no robot"
        )
    if kind == "rosbag2":
        return export_rosbag2(file, fields, output, robot, force)
    from diffbotctl.recording import fields as recording_fields

    if attachment is not None:
        return _write_attachment(file, attachment, output, force)
    keep_lines(sys.stdout)  # a table, which a person may copy
    wires, sent = recording_fields.all_wires(file)
    if fields:
        columns = recording_fields.choose_columns(fields, wires)
        for wire in dict.fromkeys(column.wire for column in columns if column.wire not in sent):
            click.echo(f"{wire} has no messages in this recording", err=True)
    else:
        columns = recording_fields.all_columns(sent)
    if output is None:
        # Another program gets the texts as they were recorded, a terminal without escapes.
        stdout: Any = sys.stdout
        if isinstance(stdout, PrintableStream) and not stdout.isatty():
            stdout = RawStream(stdout)
        _write_table(stdout, file, columns)
        return 0
    with open_output(output, [".csv"], force) as target:
        _write_table(target, file, columns, [CSV_MARK])
    return 0


def _write_table(
    target: Any, file: Path, columns: list[Any], empty_columns: Sequence[str] = ()
) -> None:
    import csv

    from diffbotctl.recording.fields import table_rows

    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(["time", *(column.name for column in columns), *empty_columns])
    empty_cells = [""] * len(empty_columns)
    for time, row in table_rows(file, columns):
        seconds = f"{time // SECOND}.{time % SECOND:09d}"
        writer.writerow([seconds, *(_cell(value) for value in row), *empty_cells])


def _cell(value: object) -> object:
    if isinstance(value, float):
        return repr(value)  # reads back as the same number
    return "" if value is None else value


@bag.command()
@exclusive("--output", ("--ascii",), "a picture has no characters")
@needs(("--force",), ("--output",), "it overwrites a file")
def plot(
    fields: tuple[str, ...] = argument("[FIELD]..."),
    file: Path = argument(),
    begin: float | None = quantity_option("s", "--from", "Start, such as 3s."),
    until: float | None = quantity_option("s", "End."),
    output: Path | None = option("Write a picture: FILE.svg or FILE.png."),
    force: bool = FORCE,
    ascii_only: bool = option("--ascii", "Draw with ASCII characters only."),
) -> None:
    """Plot the FIELDs of the recording FILE over time, in the terminal or into --output.

    Fields are named as in `topic echo`: odometry.odometry.x; a topic alone means all its numbers.
    Without FIELD, the speeds of the first odometry.
    """
    from diffbotctl.recording.fields import read_series

    if not fields:
        fields = _speed_fields(file)
    if not file.exists() and Path(fields[0]).is_file():  # as `bag export` has it
        file, fields = Path(fields[0]), (*fields[1:], str(file))
    check_span(begin, until)
    first = 0 if begin is None else round(begin * SECOND)
    last = NEVER if until is None else round(until * SECOND)
    curves = read_series(file, fields, first, last)
    if output is None:
        _plot_on_terminal(curves, ascii_only)
        return
    from diffbotctl.ui.plot.image import encode_png, encode_svg, make_figure

    figure = make_figure(curves, file.name)
    writers: dict[str, Callable[[], str | bytes]] = {
        ".svg": partial(encode_svg, figure),
        ".png": partial(encode_png, figure),
    }
    write_output(output, writers, force)


def _speed_fields(file: Path) -> tuple[str, ...]:
    """The fields of both speeds of the first odometry in a recording. Raises click.UsageError."""
    from diffbotctl.message_types import type_name
    from diffbotctl.messages import Odometry
    from diffbotctl.recording.reader import recording_info

    for topic in recording_info(file).topics:
        if topic.kind == type_name(Odometry) and topic.messages:
            return f"{topic.name}.linear", f"{topic.name}.angular"
    raise click.UsageError(
        f"{file} has no odometry: name what to plot before the file; "
        f"`diffbotctl bag info {shlex.quote(str(file))}` lists the topics"
    )


def _plot_on_terminal(curves: list[Series], ascii_only: bool) -> None:
    from diffbotctl.ui.plot import plots
    from diffbotctl.ui.plot.canvas import ASCII, BRAILLE

    size = get_terminal_size((80, 24))
    font = ASCII if ascii_only or not _can_print_braille() else BRAILLE
    for line in plots.render_plots(curves, size.columns, size.lines - 1, font):
        click.echo(line)


def _can_print_braille() -> bool:
    try:
        "\N{BRAILLE PATTERN DOTS-1}".encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return False
    return True


@bag.command()
def diff(one: Path, other: Path, as_json: bool = JSON) -> int:
    """Show where the recordings ONE and OTHER first differ, by topic, and how their metrics do.

    Exit code: 0 the same, 1 different.
    """
    from diffbotctl.recording.comparison import recording_differences
    from diffbotctl.recording.metrics import recorded_metrics
    from diffbotctl.ui import recording_text

    topics = recording_differences(one, other)
    is_different = any(topic.place is not None for topic in topics)
    if as_json:
        for topic in topics:
            print_json(topic._asdict())
        return int(is_different)
    for line in recording_text.difference_lines(topics, ("A", "B")):
        click.echo(line)
    metrics = recorded_metrics(one), recorded_metrics(other)
    if metrics[0] != metrics[1]:
        click.echo()
        for line in recording_text.metrics_table(*metrics, ("A", "B")):
            click.echo(line)
    return int(is_different)


def export_rosbag2(
    file: Path, fields: tuple[str, ...], output: Path | None, robot: str | None, force: bool
) -> int:
    """Write the recording `file` as the folder `output`, and print what it holds."""
    if fields:
        raise click.UsageError("a rosbag2 has all topics: leave out FIELD")
    if output is None:
        raise click.UsageError("a rosbag2 is a folder: name it with --output")
    try:
        from diffbotctl.ros2.bag_export import export_bag
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "rosbags":
            raise
        cause = "the package rosbags is not installed"
        fix = "pip install 'diffbotctl[ros2]'"
        raise UsageError(Problem("E-ROSBAG2", "--format", cause, fix)) from error
    _print_result(output, export_bag(file, output, robot, force))
    return 0


def _print_result(output: Path, result: ExportResult) -> None:
    width = max(map(len, result.counts), default=0)
    for topic, count in result.counts.items():
        click.echo(f"{topic:<{width}}  {count}")
    if result.omitted:
        click.echo(f"without a ROS topic: {', '.join(result.omitted)}", err=True)
    if result.complaint:
        click.echo(f"no frames, joints or velocity: {result.complaint}", err=True)
    click.echo(f"written: {output}")
