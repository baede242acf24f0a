"""Answers from a YAML file, for a calibration or a guided setup without a person.

    encoders.wheel: {measure: eye}              # what the wheel of a simulated robot really did
    distance.reading: [998 mm, 1001 mm, 999 mm] # one for each repeat
    geometry: {measure: tape, noise: 1 mm}      # every length whose name begins with `geometry.`

The longest name that matches a question answers it. `measure` reads the actual value from a
simulated or emulated robot with a simulated tool, with `noise` (standard deviation) added.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import yaml

from diffbotctl.config.yaml_reader import parse_any, read_text
from diffbotctl.errors import (
    ConfigurationError,
    Problem,
    RunError,
    Source,
    UsageError,
    UserError,
    closest_match,
    join_words,
)
from diffbotctl.prompts.question import (
    Answer,
    AnswerError,
    ExpectedQuestion,
    Hands,
    ManualAction,
    MarkFloor,
    MotionNotice,
    Question,
    motion_consent,
)
from diffbotctl.units import UnitError, quantity


class MeasuringTools(Hands, Protocol):
    """Reads the actual state of a simulated robot and moves it, as a person would.

    `offer`: what the usual instrument reads for a question, as text; empty if none can.
    """

    def mark(self) -> None: ...
    def raise_wheels(self, is_raised: bool) -> None: ...
    def read(self, instrument: str, question: Question, noise: float) -> Answer: ...
    def refuse_instrument(self, instrument: str, question: Question) -> None: ...
    def offer(self, question: Question) -> str: ...


class AnswersFile:
    """A prompter that answers from a file.

    A real robot moves only where the file has the consent to that motion, by its whole name, such
    as `motors.motion: yes`; a drive before which a person must place the robot is refused. `code`
    and `error` belong to the problems that it raises.
    """

    def __init__(
        self,
        path: Path,
        tools: MeasuringTools | None = None,
        code: str = "E-CALIBRATE-ANSWER",
        error: type[UserError] = RunError,
    ) -> None:
        """`tools` is None for a real robot. Raises UsageError for an unusable file."""
        self.path, self.tools, self.code, self.error = path, tools, code, error
        self.answers = _read(path, code)
        self._used: dict[str, int] = {}

    def check(self, expected: Sequence[ExpectedQuestion], names: Collection[str]) -> None:
        """Compare the file with the questions that will be asked, before anything moves.

        `names` of all questions there are. Raises an error with all problems: names that no
        question has, questions without an answer, answers that are none, too few of a list, and
        what needs a person or a simulated robot.
        """
        causes = [*self._unknown_names(names)]
        by_entry: dict[str, list[ExpectedQuestion]] = {}
        for item in expected:
            what = item.what
            if isinstance(what, ManualAction):
                if self.tools is None and item.times:
                    causes.append(f"{what.name}: needs a person: {what.text}")
                continue
            if what.is_consent and self.tools is not None:
                continue
            name = self._matching_name(what)
            # The entry of a whole group is for those of its questions that will be asked.
            if name is not None and (item.times or name == what.name):
                by_entry.setdefault(name, []).append(item)
            elif name is None and item.times and what.default is None:
                causes.append(f"{what.name}: is not answered in this file: {what.text}")
        for name, items in by_entry.items():
            causes += self._bad_answers(name, items)
        if causes:
            raise self.error([self._as_problem(cause) for cause in dict.fromkeys(causes)])

    def _unknown_names(self, names: Collection[str]) -> Iterator[str]:
        for entry in self.answers:
            if not any(f"{name}.".startswith(f"{entry}.") for name in names):
                near = closest_match(entry, names)
                hint = f"; did you mean {near}?" if near else f"; there are {join_words(names)}"
                yield f"{entry}: no question has this name{hint}"

    def _bad_answers(self, name: str, items: Sequence[ExpectedQuestion]) -> Iterator[str]:
        """Why the entry `name` cannot answer these questions."""
        entry = self.answers[name]
        questions = [item.what for item in items if isinstance(item.what, Question)]
        if isinstance(entry, Mapping):
            for question in questions:
                try:
                    self._noise(entry, question)
                    if self.tools is not None:
                        self.tools.refuse_instrument(entry["measure"], question)
                except AnswerError as error:
                    yield f"{name}: {error}"
            return
        for answer in entry if isinstance(entry, list) else [entry]:
            reasons = [_reason(question, answer) for question in questions]
            if all(reasons):
                yield f"{name}: {reasons[0]}"
        times = sum(item.times for item in items)
        if isinstance(entry, list) and len(entry) < times:
            yield f"{name}: it will be asked {times} times, but has {len(entry)} answers"

    def confirm_motion(self, notice: MotionNotice) -> None:
        """A simulated robot is raised or put down. Raises an error without consent to a real one's
        motion."""
        if self.tools is not None:
            self.tools.raise_wheels(notice.is_raised)
            return
        consent = motion_consent(notice.step)
        if self.answer(consent) != "yes":
            raise self._problem(consent.name, f"the motion was refused: {notice.text}")

    def mark_floor(self, mark: MarkFloor) -> None:
        """The simulated tools measure from here. Raises an error if a person has to act."""
        if self.tools is not None:
            self.tools.mark()
        elif mark.is_placed:
            raise self._problem("floor", f"needs a person: {mark.text}")

    def act(self, action: ManualAction) -> None:
        """Do it with the simulated tools. Raises an error if they cannot."""
        if self.tools is None or not action.can_be_simulated:
            raise self._problem(action.name, f"needs a person: {action.text}")
        action.simulate(self.tools)

    def answer(self, question: Question) -> Answer:
        """The file's answer, or the question's default. Raises an error if there is none."""
        name = self._matching_name(question)
        if name is None:
            if question.default is not None:
                return question.default
            raise self._problem(question.name, "is not answered in this file")
        entry = self.answers[name]
        try:
            if isinstance(entry, Mapping):
                return self._measure(entry, question)
            return question.parse(self._next(name, entry, question.is_repeated))
        except AnswerError as error:
            raise self._problem(name, str(error)) from None

    def _matching_name(self, question: Question) -> str | None:
        parts = question.name.split(".")
        shortest = len(parts) if question.is_consent else 1
        names = (".".join(parts[:count]) for count in range(len(parts), shortest - 1, -1))
        return next((name for name in names if name in self.answers), None)

    def _next(self, name: str, entry: Any, is_repeated: bool) -> Any:
        if not isinstance(entry, list):
            return entry
        number = self._used.get(name, 0) - is_repeated
        if number >= len(entry):
            raise AnswerError(f"it was asked {number + 1} times, but has {number} answers")
        self._used[name] = number + 1
        return entry[number]

    def _measure(self, entry: Mapping[str, Any], question: Question) -> Answer:
        noise = self._noise(entry, question)
        assert self.tools is not None
        return self.tools.read(entry["measure"], question, noise)

    def _noise(self, entry: Mapping[str, Any], question: Question) -> float:
        """The noise of a measured answer, in SI. Raises AnswerError if it cannot be measured."""
        if set(entry) - {"measure", "noise"} or not isinstance(entry.get("measure"), str):
            raise AnswerError("a measured answer looks like {measure: tape, noise: 1 mm}")
        if self.tools is None:
            raise AnswerError("only a simulated robot can be measured automatically")
        try:
            return quantity(str(entry.get("noise", 0)), question.unit) if question.unit else 0.0
        except UnitError as error:
            raise AnswerError(f"noise: {error}") from None

    def _problem(self, name: str, cause: str) -> UserError:
        return self.error(self._as_problem(f"{name}: {cause}"))

    def _as_problem(self, cause: str) -> Problem:
        fix = "correct the answers file, or leave out --answers and answer yourself"
        return Problem(self.code, str(self.path), cause, fix)


def _reason(question: Question, answer: Any) -> str:
    """Why `answer` is none to `question`; empty if it is one."""
    try:
        question.parse(answer)
    except AnswerError as error:
        return str(error)
    return ""


def _read(path: Path, code: str) -> dict[str, Any]:
    """Entries by the name of the question. Raises UsageError."""
    try:
        text = read_text(str(path), str(path))
        parse_any(Source(str(path), text), text)  # refuses what is too large or too deep
        # Every scalar stays a string: the question determines its type.
        entries = yaml.load(text, Loader=yaml.CBaseLoader)
    except ConfigurationError as error:
        raise UsageError(replace(problem, code=code) for problem in error.problems) from error
    except yaml.YAMLError as error:
        cause = f"cannot be read: {' '.join(str(error).split())}"
    else:
        if isinstance(entries, dict) and all(isinstance(name, str) for name in entries):
            return entries
        cause = "is not a mapping of questions to answers"
    fix = "write one per line, such as `distance.reading: [998 mm, 1002 mm]` or `lifted: yes`"
    raise UsageError(Problem(code, str(path), cause, fix))
