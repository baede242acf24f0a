"""Answers from a file, so that a calibration can run without a person.

    encoders.wheel: {measure: eye}              # what a simulated robot's wheel really did
    distance.reading: [998 mm, 1001 mm, 999 mm] # one a repeat
    geometry: {measure: tape, noise: 1 mm}      # every question that begins so and is a length

The longest name that fits a question answers it. `measure` reads the truth of a simulated or
emulated robot through an instrument, which is as blunt as `noise` says (standard deviation).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import yaml

from diffbotctl.calibrate.step import ManualAction, MarkFloor, MotionNotice
from diffbotctl.errors import Problem, RunError, UsageError
from diffbotctl.prompts.question import Answer, AnswerError, Question
from diffbotctl.units import UnitError, quantity


class Prompter(Protocol):
    """Whoever stands beside the robot: a person, or an answers file."""

    def agree(self, announced: MotionNotice) -> None:
        """Wait until the robot may move. Raises RunError when it may not."""

    def mark(self, mark: MarkFloor) -> None:
        """Make a mark where the robot stands."""

    def act(self, act: ManualAction) -> None:
        """Do it by hand."""

    def answer(self, question: Question, trouble: str) -> Answer:
        """The answer, as Question.read gives it; `trouble`: what was wrong with the last one."""


class MeasuringTools(Protocol):
    """Reads the truth of a simulated robot, as instruments.py does."""

    def mark(self) -> None: ...
    def read(self, instrument: str, question: Question, noise: float) -> Answer: ...
    def roll(self, wheel: str, turns: float) -> None: ...
    def place(self, sensor: str, distance: float) -> None: ...


class AnswersFile:
    """An attendant that answers from a file, and agrees to every movement."""

    def __init__(self, path: Path, instruments: MeasuringTools | None) -> None:
        """`instruments` is None for a real robot. Raises UsageError for an unusable file."""
        self.path = path
        self.answers = read_answers(path, "E-CALIBRATE-ANSWER", EXAMPLE)
        self.instruments = instruments
        self.used: dict[str, int] = {}

    def agree(self, announced: MotionNotice) -> None:
        """Whoever wrote the file has agreed."""

    def mark(self, mark: MarkFloor) -> None:
        """The instruments measure from here."""
        if self.instruments is not None:
            self.instruments.mark()

    def act(self, act: ManualAction) -> None:
        """Only the hand of a simulated robot can do it. Raises RunError otherwise."""
        if self.instruments is None or (act.roll is None and act.place is None):
            raise self._trouble(act.name, f"needs a hand: {act.text}")
        if act.roll is not None:
            self.instruments.roll(*act.roll)
        if act.place is not None:
            self.instruments.place(*act.place)

    def answer(self, question: Question, trouble: str) -> Answer:
        """What the file says to `question`. Raises RunError where that is nothing, or was refused.

        A question with a default is taken to be answered by it.
        """
        name = self._name(question.name)
        if name is None:
            if question.default is not None and not trouble:
                return question.default
            raise self._trouble(question.name, "is not answered there")
        said = self.answers[name]
        if trouble and not isinstance(said, list):
            raise self._trouble(name, trouble)
        try:
            if isinstance(said, Mapping):
                return self._measured(name, said, question)
            return question.read(self._next(name, said))
        except AnswerError as error:
            raise self._trouble(name, str(error)) from None

    def _name(self, asked: str) -> str | None:
        steps = asked.split(".")
        for count in range(len(steps), 0, -1):
            name = ".".join(steps[:count])
            if name in self.answers:
                return name
        return None

    def _next(self, name: str, said: Any) -> Any:
        if not isinstance(said, list):
            return said
        number = self.used.get(name, 0)
        if number >= len(said):
            raise AnswerError(f"it was asked {number + 1} times and has {number} answers")
        self.used[name] = number + 1
        return said[number]

    def _measured(self, name: str, said: Mapping[str, Any], question: Question) -> Answer:
        unknown = set(said) - {"measure", "noise"}
        if unknown or not isinstance(said.get("measure"), str):
            raise AnswerError("a measured answer looks like {measure: tape, noise: 1 mm}")
        if self.instruments is None:
            raise AnswerError("a real robot's truth can only be measured by you")
        noise = str(said.get("noise", 0))
        try:
            blunt = quantity(noise, question.unit) if question.unit else 0.0
        except UnitError as error:
            raise AnswerError(f"noise: {error}") from None
        return self.instruments.read(said["measure"], question, blunt)

    def _trouble(self, name: str, cause: str) -> RunError:
        fix = "mend the answers file, or leave --answers out and answer yourself"
        return RunError(Problem("E-CALIBRATE-ANSWER", str(self.path), f"{name}: {cause}", fix))


def read_answers(path: Path, code: str, example: str) -> dict[str, Any]:
    """What an answers file says, by the name of the question.

    Raises UsageError with `code`, and with `example` as the way out, for a file that is not one.
    """
    try:
        # Every scalar stays a text: which number or word it is, the question says.
        found = yaml.load(path.read_text(), Loader=yaml.CBaseLoader)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        cause = f"cannot be read: {' '.join(str(error).split())}"
        raise UsageError(Problem(code, str(path), cause, example)) from error
    if not isinstance(found, dict) or not all(isinstance(each, str) for each in found):
        cause = "is no list of questions and answers"
        raise UsageError(Problem(code, str(path), cause, example))
    return found


EXAMPLE = "write one a line, such as `distance.reading: [998 mm, 1002 mm]`"
