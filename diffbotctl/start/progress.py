"""What of the path is done, kept between two visits, for each robot file."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path

from diffbotctl.errors import Problem, RunError


class GuideProgress:
    """The chapters done with one robot, in a file below the user's state folder.

    `notes` are other things to remember, such as the port. What a look at the robot or its file
    tells better, is not kept here.
    """

    def __init__(self, path: Path, robot: str) -> None:
        """`robot`: the robot file's absolute path. A damaged file counts as empty."""
        self.path, self.robot = path, robot
        entry = _read(path).get(robot)
        entry = entry if isinstance(entry, dict) else {}
        done = entry.get("done", [])
        self.done: list[str] = [str(each) for each in done] if isinstance(done, list) else []
        notes = entry.get("notes", {})
        self.notes: dict[str, str] = notes if isinstance(notes, dict) else {}

    def finish(self, chapter: str) -> None:
        """This chapter is done. Raises RunError when that cannot be written."""
        if chapter not in self.done:
            self.done.append(chapter)
        self.save()

    def forget(self) -> None:
        """Begin anew with this robot. Raises RunError."""
        self.done.clear()
        self.notes.clear()
        self.save()

    def save(self) -> None:
        """Write it, whole or not at all. Raises RunError."""
        everything = _read(self.path)
        everything[self.robot] = {"done": self.done, "notes": self.notes}
        beside = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            beside.write_text(json.dumps(everything, indent=1))
            beside.replace(self.path)
        except OSError as error:
            with suppress(OSError):
                beside.unlink()
            cause = f"how far you have come cannot be kept there: {error.strerror}"
            fix = "make room or give rights there, or set XDG_STATE_HOME to another folder"
            raise RunError(Problem("E-FILE-WRITE", str(self.path), cause, fix)) from error


def state_path() -> Path:
    """Where the record lies: below the user's state folder."""
    root = os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state")
    return Path(root) / "diffbotctl" / "start.json"


def _read(path: Path) -> dict[str, object]:
    with suppress(OSError, ValueError):
        found = json.loads(path.read_text())
        if isinstance(found, dict):
            return found
    return {}
