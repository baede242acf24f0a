"""The robot file of a person's own, which the path writes into; never a shipped one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from diffbotctl.calibrate.robot_file import own_file
from diffbotctl.config import lookup
from diffbotctl.config.load import load_robot
from diffbotctl.config.rewrite import with_entry
from diffbotctl.errors import Problem, UsageError


def own(path: Path) -> Path:
    """The file at `path`, or a copy of it in ./robots where it is a shipped one.

    Raises UsageError where it cannot be copied.
    """
    return own_file(path)[0]


def refuse_shipped_folder(path: Path) -> None:
    """Raises UsageError when a new robot file at `path` would lie among the shipped ones."""
    if lookup.is_shipped(path):
        cause = "this is the folder of diffbotctl itself, whose files stay as they are"
        fix = "change to a folder of your own: mkdir ~/robot; cd ~/robot; diffbotctl start"
        raise UsageError(Problem("E-FILE-WRITE", str(path), cause, fix))


def put(path: Path, field: Sequence[str], value: str) -> None:
    """Write one value into the robot file at `path`; all else stays. Raises UsageError."""
    before = path.read_text(encoding="utf-8")
    try:
        path.write_text(with_entry(before, field, value), encoding="utf-8")
    except ValueError as error:
        fix = f"write it by hand: {'.'.join(field)} is {value}"
        raise UsageError(Problem("E-CALIBRATE-WRITE", str(path), str(error), fix)) from error
    except OSError as error:
        cause = f"cannot be written: {error.strerror}"
        raise UsageError(Problem("E-FILE-WRITE", str(path), cause, "make it yours")) from error
    load_robot(str(path.absolute()))
