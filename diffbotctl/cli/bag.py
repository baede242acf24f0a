"""`diffbotctl bag`: look into recordings."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from diffbotctl.time import SECOND

recording = click.argument("file", type=click.Path(path_type=Path))


@click.group()
def command() -> None:
    """Look into recordings: what is in them, as pictures and tables, side by side, mended."""


@command.command()
@recording
def info(file: Path) -> int:
    """What is in the recording FILE, why its run ended, and whether it is complete."""
    from diffbotctl.recording.reader import recording_info
    from diffbotctl.ui import recording_text

    for line in recording_text.info_lines(recording_info(file)):
        click.echo(line)
    return 0


@command.command()
@recording
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), help="The mended file.")
def recover(file: Path, output: Path | None) -> int:
    """Write what can be read of the damaged or unfinished recording FILE as a whole file.

    Without --output it stands beside FILE, named FILE-recovered.
    """
    from diffbotctl.recording.recover import recover

    target = output or file.with_stem(f"{file.stem}-recovered")
    done = recover(file, target)
    click.echo(f"{target}: {done.messages} messages")
    if done.damaged:
        click.echo(f"{done.damaged} damaged chunks could not be read; what was in them is missing")
    if done.cut is not None:
        click.echo(f"the recording was cut ({done.cut})")
    return 0


@command.command()
@recording
@click.argument("fields", nargs=-1, metavar="[FIELD]...")
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), help="A CSV file.")
def export(file: Path, fields: tuple[str, ...], output: Path | None) -> int:
    """Write the FIELDs of the recording FILE as CSV: odometry.odometry.x, or a topic for all of it.

    One line an instant at which one of them spoke; a field that was silent then is left empty.
    Times are seconds since the start of the run. Without FIELD everything is written.
    """
    from diffbotctl.recording import fields as fields_module

    known = fields_module.column_wires(file)
    wanted = (
        fields_module.choose_columns(fields, known) if fields else fields_module.all_columns(known)
    )
    if output is None:
        _table(sys.stdout, file, wanted)
        return 0
    try:
        with output.open("w", newline="") as target:
            _table(target, file, wanted)
    except OSError as error:
        raise click.UsageError(f"--output {output}: {error.strerror}") from error
    return 0


def _table(target: Any, file: Path, wanted: list[Any]) -> None:
    import csv

    from diffbotctl.recording.fields import table_rows

    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(["time", *(column.name for column in wanted)])
    for time, row in table_rows(file, wanted):
        seconds = f"{time // SECOND}.{time % SECOND:09d}"
        writer.writerow([seconds, *(_cell(value) for value in row)])


def _cell(value: object) -> object:
    if isinstance(value, float):
        return repr(value)  # reads back as the same number
    return "" if value is None else value


@command.command()
@click.argument("fields", nargs=-1, required=True, metavar="FIELD...")
@recording
@click.option("--from", "begin", metavar="TIME", help="Begin there, such as 3s.")
@click.option("--until", metavar="TIME", help="End there.")
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), help="x.svg or x.png.")
@click.option("--ascii", "plain", is_flag=True, help="Draw with plain characters only.")
def plot(
    fields: tuple[str, ...],
    file: Path,
    begin: str | None,
    until: str | None,
    output: Path | None,
    plain: bool,
) -> int:
    """Draw the FIELDs of the recording FILE over time, in the terminal or into --output.

    A field is named as in `topic echo`: odometry.odometry.x; a topic alone means all its numbers.
    """
    from diffbotctl.cli.engine_client import quantity_of
    from diffbotctl.recording.fields import read_series
    from diffbotctl.time import NEVER

    first = 0 if begin is None else round(quantity_of(begin, "s", "--from") * SECOND)
    last = NEVER if until is None else round(quantity_of(until, "s", "--until") * SECOND)
    drawn = read_series(file, fields, first, last)
    if output is None:
        _on_terminal(drawn, plain)
        return 0
    from diffbotctl.ui.plot.image import make_figure, save_figure

    save_figure(make_figure(drawn, file.name), output)
    click.echo(f"{output}")
    return 0


def _on_terminal(drawn: list[Any], plain: bool) -> None:
    from shutil import get_terminal_size

    from diffbotctl.ui.plot import plots
    from diffbotctl.ui.plot.canvas import ASCII, BRAILLE

    size = get_terminal_size((80, 24))
    font = ASCII if plain or not _speaks_braille() else BRAILLE
    for line in plots.render_plots(drawn, size.columns, size.lines - 1, font):
        click.echo(line)


def _speaks_braille() -> bool:
    try:
        "\N{BRAILLE PATTERN DOTS-1}".encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return False
    return True


@command.command()
@click.argument("one", type=click.Path(path_type=Path))
@click.argument("other", type=click.Path(path_type=Path))
def diff(one: Path, other: Path) -> int:
    """Where the recordings ONE and OTHER first differ, topic by topic, and how their metrics do.

    Exit code: 0 the same, 1 different.
    """
    from diffbotctl.recording.comparison import recording_differences
    from diffbotctl.recording.metrics import recorded_metrics
    from diffbotctl.ui import recording_text

    topics = recording_differences(one, other)
    for line in recording_text.difference_lines(topics, ("A", "B")):
        click.echo(line)
    both = recorded_metrics(one), recorded_metrics(other)
    if both[0] != both[1]:
        click.echo()
        for line in recording_text.metrics_table(*both, ("A", "B")):
            click.echo(line)
    return int(any(topic.place is not None for topic in topics))
