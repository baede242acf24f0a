"""The robot file of a person's own, which results are written into; never a shipped one."""

from __future__ import annotations

from pathlib import Path

from diffbotctl.calibrate.robot_file import writable_copy
from diffbotctl.config import lookup
from diffbotctl.errors import Problem, UsageError


def make_own_copy(path: Path) -> Path:
    """The file at `path`, or a copy of it in ./robots where it is a shipped one.

    Raises UsageError where it cannot be copied.
    """
    return writable_copy(path)[0]


def refuse_shipped_folder(path: Path) -> None:
    """Raises UsageError when a new robot file at `path` would lie among the shipped ones."""
    if lookup.is_shipped(path):
        cause = "this is the folder of diffbotctl itself, whose files stay as they are"
        fix = "change to a folder of your own: mkdir ~/robot; cd ~/robot; diffbotctl start"
        raise UsageError(Problem("E-FILE-WRITE", str(path), cause, fix))
