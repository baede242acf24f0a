"""`diffbotctl start`: one guided path from nothing to the first goal."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path

import click

from diffbotctl import user_folders
from diffbotctl.cli.command import command, option
from diffbotctl.cli.contradictions import exclusive
from diffbotctl.cli.options import ANSWERS, port_option
from diffbotctl.config.yaml_reader import open_regular
from diffbotctl.errors import Problem, RunError


@command("Set up", 1, "Guided setup")
@exclusive("--status", ("--again", "--answers"), "it prints the state and changes nothing")
def start(
    robot: str | None = option(
        "Your robot file; default: the only one in ./robots.", metavar="ROBOT"
    ),
    port: str = port_option("auto", only_board=True),
    radio: str | None = option("Port to drive over; default: the USB cable.", metavar="PORT"),
    answers: Path | None = ANSWERS,
    status: bool = option("Print the state and the next step only."),
    again: bool = option("Start from the beginning."),
) -> int:
    """Guided setup: from nothing to a robot that drives to a goal, step by step.

    First on a simulated robot; then, with a board connected, on yours. Ctrl-C leaves at any time;
    the next `diffbotctl start` in this folder continues from there.
    """
    from diffbotctl.cli.start_guide import SetupGuide
    from diffbotctl.cli.start_steps import read_answers

    progress = GuideProgress(state_path(), str(Path.cwd()))
    if again:
        progress.reset()
    answers_file = None if answers is None else read_answers(answers)
    guide = SetupGuide(progress, robot, None if port == "auto" else port, radio, answers_file)
    if status:
        guide.show_status()
        return 0
    try:
        return guide.run()
    except (click.Abort, KeyboardInterrupt):
        click.echo("\nLeft here. `diffbotctl start` goes on from this point.")
        raise click.Abort from None


STATE_MAX_BYTES = 1 << 20


class GuideProgress:
    """The chapters that are done, in a file below the user's state folder.

    `notes` are other values to keep, such as the port. What the robot or its file can show is not
    kept here.
    """

    def __init__(self, path: Path, key: str) -> None:
        """`key`: the absolute path of the robot folder. A damaged file counts as empty."""
        self.path, self.key = path, key
        entry = _read(path).get(key)
        entry = entry if isinstance(entry, dict) else {}
        done, notes = entry.get("done"), entry.get("notes")
        self.done: list[str] = list(map(str, done)) if isinstance(done, list) else []
        self.notes: dict[str, str] = notes if isinstance(notes, dict) else {}

    def finish(self, chapter: str) -> None:
        """Mark a chapter as done. Raises RunError if the file cannot be written."""
        if chapter not in self.done:
            self.done.append(chapter)
        self._write()

    def reset(self) -> None:
        """Forget everything about this folder. Raises RunError if the file cannot be written."""
        self.done.clear()
        self.notes.clear()
        self._write()

    def _write(self) -> None:
        """Replace the file atomically."""
        entries = _read(self.path) | {self.key: {"done": self.done, "notes": self.notes}}
        temporary = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            temporary.write_text(json.dumps(entries, indent=1))
            temporary.replace(self.path)
        except OSError as error:
            with suppress(OSError):
                temporary.unlink()
            cause = f"the progress cannot be saved: {error.strerror}"
            fix = "free disk space, change the permissions, or set XDG_STATE_HOME to another folder"
            raise RunError(Problem("E-FILE-WRITE", str(self.path), cause, fix)) from error


def state_path() -> Path:
    """The file below the user's state folder."""
    return user_folders.state_folder() / "start.json"


def _read(path: Path) -> dict[str, object]:
    with suppress(OSError, ValueError, RecursionError):
        with open_regular(path) as file:
            entries = json.loads(file.read(STATE_MAX_BYTES))
        if isinstance(entries, dict):
            return entries
    return {}
