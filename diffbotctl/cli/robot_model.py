"""`diffbotctl show`: a robot from above and from the side.

`diffbotctl frames`: the frames of a robot as a tree.

`diffbotctl export`: what other programs read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from diffbotctl.model.frames import RobotFrame


@click.command()
@click.argument("robot", required=False)
@click.option(
    "--output", type=click.Path(dir_okay=False, path_type=Path), help="Write an SVG picture."
)
def show(robot: str | None, output: Path | None) -> int:
    """Draw ROBOT from above and from its left side, to scale: here, or as a picture."""
    from diffbotctl.cli.output import load_robot_file, write_output
    from diffbotctl.render.robot_views import side, top

    found = load_robot_file(robot)
    views = [top(found.robot), side(found.robot)]
    if output is not None:
        from diffbotctl.render.robot_svg import svg

        write_output(output, svg(found.file.stem, views))
        return 0
    from rich.console import Console

    from diffbotctl.ui.map.layers import render_robot_view

    console = Console(highlight=False)
    console.print(f"[bold]{found.file.stem}[/bold]")
    for view in views:
        console.print(render_robot_view(view, console.width))
    return 0


MOVES = {
    "odometry": "moves with odometry",
    "wheel": "turns with the wheel",
    "": "fixed",
}


@click.command()
@click.argument("robot", required=False)
def frames(robot: str | None) -> int:
    """Print the frames of ROBOT as a tree, each with its place in the frame above it.

    Names as REP-105 has them: x points forward, y left, z up; m and deg.
    """
    from diffbotctl.cli.output import load_robot_file
    from diffbotctl.model.frames import WORLD, frames

    click.echo(WORLD)
    for line in branches(list(frames(load_robot_file(robot).robot)), WORLD, ""):
        click.echo(line)
    return 0


def branches(all_of_them: Iterable[RobotFrame], parent: str, margin: str) -> Iterator[str]:
    """The lines of the tree below `parent`."""
    children = [frame for frame in all_of_them if frame.parent == parent]
    for frame in children:
        is_last = frame is children[-1]
        label = f"{margin}{'└── ' if is_last else '├── '}{frame.name}"
        yield f"{label:<34} {described_frame(frame)}"
        yield from branches(all_of_them, frame.name, margin + ("    " if is_last else "│   "))


def described_frame(frame: RobotFrame) -> str:
    """Where a frame is, and what moves it."""
    if frame.moves == "odometry":
        return MOVES[frame.moves]
    # Without -0: a person reads it as something else than 0.
    x, y, z = (round(each, 4) + 0.0 for each in (frame.x, frame.y, frame.z))
    turned = f"  heading {degrees(frame.heading):g} deg" if frame.heading else ""
    return f"x {x:+.4f}  y {y:+.4f}  z {z:+.4f}{turned}  {MOVES[frame.moves]}"


@click.group()
def export() -> None:
    """Write a robot as a file that other programs read."""


@export.command()
@click.argument("robot", required=False)
@click.option("--name", help="The robot's name in the model; without it that of its file.")
@click.option(
    "--output", type=click.Path(dir_okay=False, path_type=Path), help="Write to this file."
)
def urdf(robot: str | None, name: str | None, output: Path | None) -> int:
    """Write ROBOT as URDF: its frames, shapes, masses and inertia, calibrated values included."""
    from diffbotctl.cli.output import load_robot_file, write_output
    from diffbotctl.model.urdf import urdf as as_urdf

    found = load_robot_file(robot)
    text = as_urdf(found.robot, name or found.file.stem)
    if output is None:
        click.echo(text, nl=False)
    else:
        write_output(output, text)
    return 0
