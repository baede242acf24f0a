"""The questions of the path, and the answers file that can stand in for a person.

lifted: yes
measure: later
floor: yes

What a calibration asks on the way is answered by the names that its own answers file has.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from diffbotctl.calibrate.answers_file import read_answers
from diffbotctl.calibrate.runner import STEPS
from diffbotctl.errors import Problem, UsageError, closest_match, join_words

EXAMPLE = "write one a line, such as `lifted: yes`"


class GuideQuestion(NamedTuple):
    """A question by the name that an answers file calls it; `no` ends the visit."""

    name: str
    text: str
    choices: tuple[str, ...] = ("yes", "no")


QUESTIONS = {
    each.name: each
    for each in (
        GuideQuestion(
            "lifted",
            "Are the wheels in the air, so that they can turn without moving the robot?",
        ),
        GuideQuestion(
            "measure",
            "Measure now: all, which needs a tape and half an hour; the motors alone, which needs "
            "two minutes and nothing; or later?",
            ("all", "motors", "later"),
        ),
        GuideQuestion(
            "floor",
            "Does it stand on the floor, with 1.5 m free ahead and 1 m to its left, and can you "
            "reach it?",
        ),
    )
}


class GuideAnswers:
    """An answers file. A list answers a question that is asked several times, one after another."""

    def __init__(self, path: Path) -> None:
        """Raises UsageError for a file that is not one, or with a name that is no question."""
        self.path = path
        self._answers = read_answers(path, "E-START-ANSWER", EXAMPLE)
        self._asked: dict[str, int] = {}
        for name in self._answers:
            if name not in QUESTIONS and name.partition(".")[0] not in STEPS:
                near = closest_match(name, list(QUESTIONS)) or join_words(list(QUESTIONS), "or")
                raise self._trouble(f"'{name}' is never asked", f"did you mean {near}?")

    def answer(self, question: GuideQuestion) -> str:
        """The file's answer. Raises UsageError where there is none."""
        if question.name not in self._answers:
            fix = f"add a line: {question.name}: {question.choices[0]}"
            raise self._trouble(f"does not answer '{question.name}': {question.text}", fix)
        said = self._answers[question.name]
        if isinstance(said, list):
            number = self._asked.get(question.name, 0)
            self._asked[question.name] = number + 1
            said = said[number] if number < len(said) else ""
        if said not in question.choices:
            cause = f"'{said}' is no answer to '{question.name}'"
            raise self._trouble(cause, f"say {join_words(question.choices, 'or')}")
        return str(said)

    def _trouble(self, cause: str, fix: str) -> UsageError:
        return UsageError(Problem("E-START-ANSWER", str(self.path), cause, fix))
