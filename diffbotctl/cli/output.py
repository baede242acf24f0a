"""What the commands that only look at a robot file have in common: they read it, and they write."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from diffbotctl.config.configuration import RobotFile


def load_robot_file(robot: str | None) -> RobotFile:
    """The robot called `robot`, its warnings printed. Raises ConfigurationError."""
    from diffbotctl.config.load import load_robot

    found = load_robot(robot)
    for warning in found.warnings:
        click.echo(warning.render(), err=True)
    return found


def write_output(output: Path, text: str) -> None:
    """Write `text` to `output` and say so. Raises RunError where that cannot be."""
    from diffbotctl.errors import Problem, RunError

    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        cause = f"cannot write there: {error.strerror}"
        raise RunError(Problem("E-OUTPUT", str(output), cause, "give another file")) from error
    click.echo(f"written: {output}")
