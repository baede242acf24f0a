"""`diffbotctl export`: what other programs read."""

from __future__ import annotations

from pathlib import Path

import click


@click.group()
def command() -> None:
    """Write a robot as a file that other programs read."""


@command.command()
@click.argument("robot", required=False)
@click.option("--name", help="The robot's name in the model; without it that of its file.")
@click.option(
    "--output", type=click.Path(dir_okay=False, path_type=Path), help="Write to this file."
)
def urdf(robot: str | None, name: str | None, output: Path | None) -> int:
    """Write ROBOT as URDF: its frames, shapes, masses and inertia, calibrated values included."""
    from diffbotctl.cli.robot_argument import loaded, written
    from diffbotctl.model.urdf import urdf as as_urdf

    found = loaded(robot)
    text = as_urdf(found.robot, name or found.file.stem)
    if output is None:
        click.echo(text, nl=False)
    else:
        written(output, text)
    return 0
