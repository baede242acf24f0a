"""What commands write: output files, which are never overwritten unasked, and JSON lines."""

from __future__ import annotations

import json
import os
import shutil
import stat
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.errors import Problem, RunError, UsageError, join_words
from diffbotctl.printable import keep_lines

if TYPE_CHECKING:
    from diffbotctl.config.configuration import RobotFile
    from diffbotctl.errors import Problem

CSV_MARK = "diffbotctl"  # name of the last column of our tables, which is empty
MEMORY_DEVICES = 1  # their major number in Linux: /dev/null, /dev/zero, /dev/full
MARK_BYTES_MAX = 64 << 10  # our files carry their mark within so many bytes
# Formats by their first bytes, and the mark near the beginning of a file that diffbotctl wrote.
MARKS = {
    b"\x89PNG": b"tEXtSoftware\0diffbotctl",
    b"\x89MCAP": b"\x0a\0\0\0diffbotctl",  # the field `library` of the header, with its length
    b"PK\x03\x04": b"diffbotctl_bundle/",  # the folder in a bundle of `doctor`
    b"<svg": b"<!-- diffbotctl -->",
    b"<?xml": b"<!-- diffbotctl -->",
    b"<!doctype": b"<!-- diffbotctl -->",
    b"//": b"// diffbotctl\n",  # Graphviz
    b"%%": b"%% diffbotctl\n",  # Mermaid
}


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

    Also, with or without `force`, when a run is recorded to it at this time.
    """
    from diffbotctl.recording.recording_file import IN_USE, is_being_written

    refuse_special_file(output)
    if not output.is_file():
        return
    if is_being_written(output):
        fix = (
            "choose another name, or end the other one first (`diffbotctl engines` lists the runs)"
        )
        raise UsageError(Problem("E-OUTPUT", str(output), IN_USE, fix))
    if force:
        return
    try:
        with output.open("rb") as file:
            start = file.read(MARK_BYTES_MAX)
    except OSError:
        start = b"?"
    if start and not has_mark(start):
        cause = "the file exists already, and diffbotctl did not write it"
        fix = "choose another name, or add --force to overwrite it"
        raise UsageError(Problem("E-OUTPUT", str(output), cause, fix))


def refuse_special_file(output: Path) -> None:
    """Raises UsageError for a pipe, a socket, or a device other than /dev/null and /dev/full.

    A pipe would wait for its reader, and what is written to the port of a board moves a robot.
    """
    try:
        state = output.stat()
    except OSError:
        return  # a new file; one that cannot be written is reported when it is opened
    mode = state.st_mode
    is_memory = stat.S_ISCHR(mode) and os.major(state.st_rdev) == MEMORY_DEVICES
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or is_memory):
        cause = "this is a device or a pipe, not a file"
        raise UsageError(Problem("E-OUTPUT", str(output), cause, "choose another name"))


def has_mark(start: bytes) -> bool:
    """Whether a file with these first bytes carries the mark of diffbotctl for its format."""
    for magic, mark in MARKS.items():
        if start.startswith(magic):
            return mark in start
    first_line = start.partition(b"\n")[0].rstrip(b"\r")
    return first_line.startswith(b"time,") and first_line.endswith(f",{CSV_MARK}".encode())


@contextmanager
def open_output(output: Path, suffixes: Iterable[str], force: bool) -> Iterator[TextIOWrapper]:
    """The file `output`, open for text; prints its name at the end.

    It is written whole or not at all: until the end, an existing one stays as it was. Raises
    UsageError as `check_output`, RunError when the file cannot be written.
    """
    check_output(output, suffixes, force)
    target = Path(os.path.realpath(output))
    is_special = target.exists() and not target.is_file()  # a pipe, or a terminal
    draft = target if is_special else target.with_name(f".{target.name}.part")
    try:
        with draft.open("w", encoding="utf-8", newline="") as file:
            yield file
        if not is_special:
            if target.exists():
                shutil.copymode(target, draft)
            draft.replace(target)
    except OSError as error:
        cause = f"cannot write the file: {error.strerror}"
        raise RunError(Problem("E-OUTPUT", str(output), cause, "choose another file")) from error
    finally:
        if not is_special:
            with suppress(OSError):
                draft.unlink(missing_ok=True)
    click.echo(f"written: {output}")


def write_output(
    output: Path, writers: Mapping[str, Callable[[], str | bytes]], force: bool
) -> None:
    """Write what `writers` makes for the suffix of `output`, and print the name.

    Raises as `open_output`; what a writer raises leaves the file as it was.
    """
    content = writers[check_output(output, writers, force)]()
    with open_output(output, writers, force) as file:
        if isinstance(content, str):
            file.write(content)
        else:
            file.buffer.write(content)


def print_json(record: object) -> None:
    """One JSON object on a line, whole on every terminal, flushed."""
    keep_lines(sys.stdout)
    print(json.dumps(record), flush=True)


def print_row(as_json: bool, record: object, text: str) -> None:
    """One JSON object on a line with `--json`, else the text; flushed."""
    if as_json:
        print_json(record)
    else:
        print(text, flush=True)


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
