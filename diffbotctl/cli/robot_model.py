"""`diffbotctl show`, `frames` and `export`: a robot as a picture, as a tree of frames, as URDF."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from math import degrees
from pathlib import Path
from shutil import get_terminal_size
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import command, group, option
from diffbotctl.cli.contradictions import needs
from diffbotctl.cli.options import FORCE, JSON, ROBOT_OBJECT
from diffbotctl.cli.output import load_robot_file, print_json, write_output
from diffbotctl.printable import keep_lines

if TYPE_CHECKING:
    from diffbotctl.model.frames import RobotFrame

MOTION_TEXTS = {
    "odometry": "moves with odometry",
    "wheel": "turns",
    "": "fixed",
}


@command("Files", 5, "; draw the robot")
@needs(("--force",), ("--output",), "it overwrites a file")
def show(
    output: Path | None = option("Write an SVG picture: FILE.svg."),
    force: bool = FORCE,
    robot: str | None = ROBOT_OBJECT,
) -> None:
    """Draw ROBOT from above and from its left side, to scale: in the terminal, or as a picture."""
    from diffbotctl.render.robot_drawing import side_view, top_view

    file = load_robot_file(robot)
    views = [top_view(file.robot), side_view(file.robot)]
    if output is not None:
        from diffbotctl.render.robot_drawing import drawing_svg

        write_output(output, {".svg": lambda: drawing_svg(file.file.stem, views)}, force)
        return
    from diffbotctl.ui.console import PrintableConsole
    from diffbotctl.ui.map.layers import render_robot_view

    console = PrintableConsole(highlight=False)
    console.print(file.file.stem, style="bold", markup=False)
    for view in views:
        console.print(render_robot_view(view, console.width))


@command("Files", 6, "Print coordinate frames")
def frames(as_json: bool = JSON, robot: str | None = ROBOT_OBJECT) -> None:
    """Print the coordinate frames of ROBOT as a tree, each with its pose in its parent frame.

    Frame names follow REP-105; x points forward, y left, z up; lengths in m, angles in deg.
    """
    from diffbotctl.model.frames import WORLD, robot_frames

    all_frames = list(robot_frames(load_robot_file(robot).robot))
    if as_json:
        for frame in all_frames:
            print_json(frame._asdict())
        return
    lines = [WORLD, *branch_lines(all_frames, WORLD, "")]
    width = max(map(len, lines))
    if get_terminal_size((width, 24)).columns < width:  # a pipe has any number of columns
        lines = list(frame_rows(all_frames))
    for line in lines:
        click.echo(line)


def frame_rows(all_frames: Sequence[RobotFrame]) -> Iterator[str]:
    """Two rows for each frame, for a terminal that is too narrow for the tree."""
    for frame in all_frames:
        yield f"{frame.name} in {frame.parent}"
        yield f"  {frame_text(frame)}"


def branch_lines(all_frames: Sequence[RobotFrame], parent: str, margin: str) -> Iterator[str]:
    """The lines of the tree below `parent`."""
    children = [frame for frame in all_frames if frame.parent == parent]
    for frame in children:
        is_last = frame is children[-1]
        label = f"{margin}{'└── ' if is_last else '├── '}{frame.name}"
        yield f"{label:<34} {frame_text(frame)}"
        yield from branch_lines(all_frames, frame.name, margin + ("    " if is_last else "│   "))


def frame_text(frame: RobotFrame) -> str:
    """The pose of a frame in its parent, and what moves it."""
    if frame.moves == "odometry":
        return MOTION_TEXTS[frame.moves]
    # The sum turns -0.0 into 0.0, so that no sign is printed.
    x, y, z = (round(value, 4) + 0.0 for value in (frame.x, frame.y, frame.z))
    heading = f"  heading {degrees(frame.heading):g} deg" if frame.heading else ""
    return f"x {x:+.4f}  y {y:+.4f}  z {z:+.4f} m{heading}  {MOTION_TEXTS[frame.moves]}"


@group("Files", 7, "; write URDF")
def export() -> None:
    """Write a robot as a file for other programs."""


@export.command()
@needs(("--force",), ("--output",), "it overwrites a file")
def urdf(
    name: str | None = option("Name of the robot in the model; default: the file's name."),
    output: Path | None = option("Write to FILE.urdf instead of standard output."),
    force: bool = FORCE,
    robot: str | None = ROBOT_OBJECT,
) -> None:
    """Write ROBOT as URDF: frames, shapes, masses and inertia, with its calibrated values."""
    from diffbotctl.model.urdf import urdf as urdf_text

    file = load_robot_file(robot)
    text = urdf_text(file.robot, name or file.file.stem)
    if output is None:
        keep_lines(sys.stdout)
        click.echo(text, nl=False)
    else:
        write_output(output, {".urdf": lambda: text, ".xml": lambda: text}, force)
