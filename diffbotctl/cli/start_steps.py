"""The chapters of the guided setup, the questions that it asks, and the file that answers them.

Their texts are in start.yaml.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import yaml

from diffbotctl import user_folders
from diffbotctl.calibrate.runner import STEPS
from diffbotctl.cli.new import kits
from diffbotctl.config.composed_robot import PART_KINDS, USUAL_SLOTS
from diffbotctl.config.yaml_reader import open_regular
from diffbotctl.errors import Problem, RunError, UsageError, closest_match, join_words
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.prompts.question import Answer, AnswerError, Question

ANSWER_CODE = "E-START-ANSWER"


class ChapterKey(StrEnum):
    """A chapter, as the progress file names it."""

    SIMULATED = "simulated"
    ROBOT = "robot"
    BOARD = "board"
    FIRMWARE = "firmware"
    WHEELS = "wheels"
    MEASURE = "measure"
    METRE = "metre"
    GOAL = "goal"


class Chapter(NamedTuple):
    """One chapter, and its texts."""

    key: ChapterKey
    title: str
    ahead: str  # what will happen
    truth: str  # what is true once it is done


_TEXTS = yaml.safe_load(Path(__file__).with_name("start.yaml").read_text(encoding="utf-8"))
CHAPTERS = tuple(Chapter(ChapterKey(key), **row) for key, row in _TEXTS["chapters"].items())
MESSAGES: dict[str, str] = _TEXTS["messages"]


def headline(key: ChapterKey) -> str:
    """The headline of a chapter, such as `3 of 8  The board`."""
    number = next(n for n, chapter in enumerate(CHAPTERS, 1) if chapter.key is key)
    return f"{number} of {len(CHAPTERS)}  {CHAPTERS[number - 1].title}"


OTHER_PARTS = "other"  # the answer of a robot that is no kit


class PartQuestion(Question):
    """A question for a part; its name is one of PART_KINDS."""

    def parse(self, answer: object) -> Answer:
        """The part's name. Raises AnswerError with what comes nearest."""
        if not str(answer or "").strip():
            return super().parse(answer)
        with suppress(AnswerError):
            if self.name != "driver":  # the beginning of a chip's name is that of others
                return super().parse(answer)
        try:
            return PART_KINDS[self.name].check(str(answer))
        except UsageError as error:
            problem = error.problems[0]
            raise AnswerError(f"{problem.cause}; {problem.fix}") from None


def question(name: str, default: str | None = None) -> Question:
    """The question called `name`; `default`: the answer for an empty line, in place of its own."""
    row = dict(_TEXTS["questions"][name])
    if default is not None:
        row["default"] = default
    if name in PART_KINDS:
        return PartQuestion(name, choices=PART_KINDS[name].names, **row)
    if name == "kit":
        titles = (*(kit.title for kit in kits().values()), "I name its parts")
        return Question(name, choices=(*kits(), OTHER_PARTS), labels=titles, **row)
    return Question(name, **row | {"choices": tuple(row["choices"])})


def slots_question(encoders: str) -> Question:
    """How many slots the encoders of a kind have."""
    text, usual = _TEXTS["questions"]["slots"]["text"], float(USUAL_SLOTS[encoders])
    return Question("slots", text, unit="1", minimum=1, default=usual, is_whole=True)


QUESTIONS = (
    *(question(name) for name in _TEXTS["questions"] if name != "slots"),
    slots_question("one-channel"),
)


def read_answers(path: Path) -> AnswersFile:
    """The answers to QUESTIONS and to those of the calibration.

    Raises UsageError for an unusable file, or one with a name that is not a question.
    """
    answers = AnswersFile(path, code=ANSWER_CODE, error=UsageError)
    names = [question.name for question in QUESTIONS]
    for name in answers.answers:
        if name not in names and name.partition(".")[0] not in STEPS:
            near = closest_match(name, names) or join_words(names, "or")
            cause, fix = f"there is no question '{name}'", f"did you mean {near}?"
            raise UsageError(Problem(ANSWER_CODE, str(path), cause, fix))
    return answers


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
