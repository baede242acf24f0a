"""What commands write: output files, which are never overwritten unasked, and JSON lines."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from diffbotctl.config.configuration import RobotFile
    from diffbotctl.errors import Problem

MARK_BYTES = 4096  # our files carry our name within so many bytes


def load_robot_file(robot: str | None) -> RobotFile:
    """The robot called `robot`; prints its warnings. Raises ConfigurationError."""
    from diffbotctl.config.load import load_robot

    file = load_robot(robot)
    for warning in file.warnings:
        click.echo(warning.render(), err=True)
    return file


def check_output(output: Path, suffixes: Iterable[str], force: bool) -> str:
    """The suffix of `output`, which decides the format.

    Raises UsageError for a suffix that is not in `suffixes`, and as `check_overwrite`.
    """
    from diffbotctl.errors import Problem, UsageError, join_words

    suffixes = list(suffixes)
    suffix = output.suffix.lower()
    if suffix not in suffixes:
        cause = f"the suffix '{output.suffix}' names no format of this command"
        fix = f"end the file name in {join_words(suffixes)}"
        raise UsageError(Problem("E-OUTPUT", str(output), cause, fix))
    check_overwrite(output, force)
    return suffix


def check_overwrite(output: Path, force: bool) -> None:
    """Raises UsageError when `output` exists and diffbotctl did not write it, without `force`.

    Our own files carry our name near their beginning; tables begin with the column `time`.
    """
    from diffbotctl.errors import Problem, UsageError

    if force or not output.is_file():
        return
    try:
        with output.open("rb") as file:
            start = file.read(MARK_BYTES)
    except OSError:
        start = b"?"
    if start and b"diffbotctl" not in start and not start.startswith(b"time,"):
        cause = "the file exists already, and diffbotctl did not write it"
        fix = "choose another name, or add --force to overwrite it"
        raise UsageError(Problem("E-OUTPUT", str(output), cause, fix))


def write_output(output: Path, writers: dict[str, Callable[[], str]], force: bool) -> None:
    """Write the text that `writers` makes for the suffix of `output`, and print the name.

    Raises UsageError as `check_output`, RunError when the file cannot be written.
    """
    from diffbotctl.errors import Problem, RunError

    text = writers[check_output(output, writers, force)]()
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        cause = f"cannot write the file: {error.strerror}"
        raise RunError(Problem("E-OUTPUT", str(output), cause, "choose another file")) from error
    click.echo(f"written: {output}")


def print_json(record: object) -> None:
    """One JSON object on a line, flushed."""
    print(json.dumps(record), flush=True)


def problem_record(problem: Problem) -> dict[str, Any]:
    """A problem as JSON has it; line and column are 0 when the whole file is meant."""
    return {
        "severity": problem.severity,
        "code": problem.code,
        "file": problem.file,
        "line": problem.line,
        "column": problem.column,
        "cause": problem.cause,
        "fix": problem.fix,
    }
