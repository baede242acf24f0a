"""Whoever answers the questions of `diffbotctl start`: a person at the terminal, or a file."""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING

import click

from diffbotctl.start.answers import QUESTIONS
from diffbotctl.ui.paragraph import folded

if TYPE_CHECKING:
    from pathlib import Path

    from diffbotctl.start.answers import Answers


class Enough(Exception):  # noqa: N818 - no error
    """The walk ends here for now, and nothing is wrong."""


class Attendant:
    """Asks each question of one visit where it has to be asked."""

    def __init__(self, answers: Answers | None) -> None:
        self._answers = answers
        self._agreed: set[str] = set()

    @property
    def is_person(self) -> bool:
        """True when no file answers."""
        return self._answers is None

    @property
    def file(self) -> Path | None:
        """The answers file."""
        return None if self._answers is None else self._answers.path

    def agree(self, name: str) -> None:
        """Have something agreed to, once a visit. Raises Enough when it is not."""
        if name not in self._agreed and self.ask(name) != "yes":
            raise Enough("Then do that first; `diffbotctl start` goes on here.")
        self._agreed.add(name)

    def ask(self, name: str) -> str:
        """The answer to the question called `name`. Raises UsageError when nobody answers."""
        from diffbotctl.errors import Problem, UsageError

        question = QUESTIONS[name]
        if self._answers is not None:
            answer = self._answers.answer(question)
            click.echo(folded(f"  {question.text} {answer}"))
            return answer
        if not sys.stdin.isatty():
            fix = f"give --answers FILE with a line such as {name}: {question.choices[0]}"
            raise UsageError(Problem("E-START-ANSWER", name, "nobody is there to be asked", fix))
        found: str = click.prompt(
            folded(f"  {question.text} ({', '.join(question.choices)})"),
            value_proc=partial(_chosen, question.choices),
        )
        return found


def _chosen(choices: tuple[str, ...], typed: str) -> str:
    """The choice that begins like what was typed. Raises BadParameter for none, or several."""
    from diffbotctl.errors import listed

    word = typed.strip().lower()
    begun = [each for each in choices if word and each.startswith(word)]
    if len(begun) != 1:
        raise click.BadParameter(f"answer {listed(choices)}")
    return begun[0]
