"""`diffbotctl frames`: the frames of a robot as a tree."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import degrees
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from diffbotctl.model.frames import RobotFrame

MOVES = {
    "odometry": "moves with odometry",
    "wheel": "turns with the wheel",
    "": "fixed",
}


@click.command()
@click.argument("robot", required=False)
def command(robot: str | None) -> int:
    """Print the frames of ROBOT as a tree, each with its place in the frame above it.

    Names as REP-105 has them: x points forward, y left, z up; m and deg.
    """
    from diffbotctl.cli.robot_argument import loaded
    from diffbotctl.model.frames import WORLD, frames

    click.echo(WORLD)
    for line in branches(list(frames(loaded(robot).robot)), WORLD, ""):
        click.echo(line)
    return 0


def branches(all_of_them: Iterable[RobotFrame], parent: str, margin: str) -> Iterator[str]:
    """The lines of the tree below `parent`."""
    children = [frame for frame in all_of_them if frame.parent == parent]
    for frame in children:
        is_last = frame is children[-1]
        label = f"{margin}{'└── ' if is_last else '├── '}{frame.name}"
        yield f"{label:<34} {described(frame)}"
        yield from branches(all_of_them, frame.name, margin + ("    " if is_last else "│   "))


def described(frame: RobotFrame) -> str:
    """Where a frame is, and what moves it."""
    if frame.moves == "odometry":
        return MOVES[frame.moves]
    # Without -0: a person reads it as something else than 0.
    x, y, z = (round(each, 4) + 0.0 for each in (frame.x, frame.y, frame.z))
    turned = f"  heading {degrees(frame.heading):g} deg" if frame.heading else ""
    return f"x {x:+.4f}  y {y:+.4f}  z {z:+.4f}{turned}  {MOVES[frame.moves]}"
