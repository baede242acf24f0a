"""`diffbotctl wiring`: every wire of a robot, as a picture and a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from shutil import get_terminal_size
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import command, option
from diffbotctl.cli.contradictions import exclusive, needs
from diffbotctl.cli.options import FORCE, JSON, ROBOT_OBJECT
from diffbotctl.cli.output import print_json, write_output
from diffbotctl.config.lookup import display_path
from diffbotctl.printable import fold_words
from diffbotctl.ui.text import render_columns

if TYPE_CHECKING:
    from diffbotctl.render.harness import Harness

WIRING_WARNINGS = ("W-WIRING-LEVEL", "W-WIRING-SHARED", "W-WIRING-LIGHT", "W-WIRING-SUPPLY")
WIDTH = 80  # columns of the narrowest terminal in common use
NOTE_MIN = 20  # columns; a narrower terminal folds them once more


@command("Files", 4, "Draw the wiring of a robot")
@exclusive("--output", ("--table", "--json"), "a picture has no table")
@exclusive("--json", ("--table",), "each is another form of the same rows")
@needs(("--force",), ("--output",), "it overwrites a file")
def wiring(
    output: Path | None = option("Write an SVG picture to print or for a browser: FILE.svg."),
    force: bool = FORCE,
    table: bool = option("Print the table only."),
    as_json: bool = JSON,
    robot: str | None = ROBOT_OBJECT,
) -> None:
    """Show every wire of ROBOT with the usual colours: a picture (from 80 columns) and a table.

    Warnings are those of `check`. The drawing is made from the robot file alone.
    """
    from diffbotctl.config.load import load_robot
    from diffbotctl.render.harness import harness, notes
    from diffbotctl.render.wiring_svg import wiring_svg

    file = load_robot(robot)
    for warning in file.warnings:
        if warning.code in WIRING_WARNINGS:
            click.echo(f"{warning.render()}\n", err=True)
    wires = harness(file.robot)
    if output is not None:
        title = f"Wiring of {file.file.stem}"
        write_output(output, {".svg": lambda: wiring_svg(wires, notes(file.robot), title)}, force)
        return
    if as_json:
        _print_json_rows(wires)
        return
    if not table:
        click.echo(f"{display_path(file.file)}\n")
        _draw(wires, notes(file.robot))
    for line in table_lines(wires):
        click.echo(line)


def _print_json_rows(harness: Harness) -> None:
    for wire in harness.wires:
        print_json(
            {
                "from": {"part": wire.start.part, "pin": wire.start.name},
                "to": {"part": wire.end.part, "pin": wire.end.name},
                "colour": wire.colour,
                "purpose": wire.purpose,
                "through": "" if wire.through is None else str(wire.through),
            }
        )


def table_lines(harness: Harness) -> Iterator[str]:
    def end_text(part: str, pin: str) -> str:
        return f"{harness.parts[part].title} {pin}"

    yield from render_columns(
        [
            ("from", "to", "colour", "purpose"),
            *(
                (
                    end_text(*wire.start),
                    end_text(*wire.end),
                    wire.colour,
                    f"{wire.purpose}: {wire.through}" if wire.through is not None else wire.purpose,
                )
                for wire in harness.wires
            ),
        ]
    )


def _draw(harness: Harness, notes: Iterable[str]) -> None:
    from diffbotctl.render.wiring_terminal import wiring_text
    from diffbotctl.ui.console import PrintableConsole

    columns = min(get_terminal_size((WIDTH, 24)).columns, WIDTH)
    if columns == WIDTH:
        PrintableConsole(width=WIDTH, highlight=False).print(wiring_text(harness))
        click.echo()
    for note in notes:
        for row in fold_words(note, max(columns - 2, NOTE_MIN), "- ", "  "):
            click.echo(row)
    click.echo()
