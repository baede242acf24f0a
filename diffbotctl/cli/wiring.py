"""`diffbotctl wiring`: every wire of a robot, as a picture, a table and what to mind."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from diffbotctl.config.harness import Harness

OWN = ("W-WIRING-LEVEL", "W-WIRING-SHARED", "W-WIRING-LIGHT", "W-WIRING-SUPPLY")  # warnings
WIDTH = 80  # columns of a terminal that everybody has


@click.command()
@click.argument("robot", required=False)
@click.option(
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the picture as SVG, for a browser or to print.",
)
@click.option("--table", is_flag=True, help="Only the table.")
def command(robot: str | None, output: Path | None, table: bool) -> None:
    """Show every wire of ROBOT, a name or a file, with the usual colours.

    Warnings are those of `check`. What stands here is made from the robot file alone.
    """
    from diffbotctl.cli.output import write_output
    from diffbotctl.config.harness import harness, notes
    from diffbotctl.config.load import load_robot
    from diffbotctl.config.lookup import display_path
    from diffbotctl.render.wiring_svg import drawing

    file = load_robot(robot)
    for warning in file.warnings:
        if warning.code in OWN:
            click.echo(f"{warning.render()}\n", err=True)
    wires = harness(file.robot)
    if output is not None:
        write_output(output, drawing(wires, notes(file.robot), f"Wiring of {file.file.stem}"))
        return
    if not table:
        click.echo(f"{display_path(file.file)}\n")
        _draw(wires, notes(file.robot))
    for line in rows(wires):
        click.echo(line)


def rows(harness: Harness) -> Iterator[str]:
    """The table: one line a wire, its ends, colour and purpose."""
    from diffbotctl.ui.text import render_columns

    def called(part: str, pin: str) -> str:
        return f"{harness.parts[part].title} {pin}"

    yield from render_columns(
        [
            ("from", "to", "colour", "what"),
            *(
                (
                    called(*wire.start),
                    called(*wire.end),
                    wire.colour,
                    f"{wire.purpose}: {wire.through}" if wire.through else wire.purpose,
                )
                for wire in harness.wires
            ),
        ]
    )


def _draw(harness: Harness, notes: Iterable[str]) -> None:
    from textwrap import fill

    from rich.console import Console

    from diffbotctl.render.wiring_terminal import picture

    Console(width=WIDTH, highlight=False).print(picture(harness))
    click.echo()
    for note in notes:
        click.echo(fill(note, WIDTH - 2, initial_indent="- ", subsequent_indent="  "))
    click.echo()
