"""What a person is asked during a calibration, and what counts as an answer."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, pi

from diffbotctl.errors import closest_match, join_words
from diffbotctl.params import with_unit
from diffbotctl.units import UNITS, UnitError, quantity

Answer = float | str


class AnswerError(ValueError):
    """An answer that cannot be one; its words say why, so that the question can be asked again."""


@dataclass(frozen=True, slots=True)
class Question:
    """One question. Its `name`, such as `distance.reading`, is what an answers file calls it."""

    name: str
    text: str
    """what to look at or measure, and how"""
    unit: str = ""
    """SI unit of a number (`m`, `rad`, `V`, `1`); empty: a choice"""
    written: str = ""
    """unit of a number that is typed without one, such as `mm`"""
    least: float = -float("inf")
    most: float = float("inf")
    why: str = ""
    """what it would mean to be beyond `least` or `most`"""
    choices: tuple[str, ...] = ()
    quantity: str = ""
    """which truth of a simulated robot an instrument would read for it, see instruments.py"""
    default: Answer | None = None
    """what Enter alone means"""

    def read(self, answer: object) -> Answer:
        """The answer as SI number or choice. Raises AnswerError with the reason."""
        if answer is None or (isinstance(answer, str) and not answer.strip()):
            if self.default is None:
                raise AnswerError(f"an answer is needed: {self.wanted}")
            return self.default
        if isinstance(answer, bool) or not isinstance(answer, str | int | float):
            raise AnswerError(f"{answer!r} is no answer: {self.wanted}")
        return self._choice(str(answer)) if self.choices else self._number(answer)

    @property
    def wanted(self) -> str:
        """What an answer looks like."""
        if self.choices:
            return join_words(self.choices, "or")
        written = self.written if self.written not in ("", "1") else ""
        return f"a number in {written}" if written else "a number"

    def _choice(self, answer: str) -> str:
        word = answer.strip().lower()
        if word in self.choices:
            return word
        begun = [each for each in self.choices if each.startswith(word)]
        if len(begun) == 1:
            return begun[0]
        near = closest_match(word, self.choices)
        hint = f"; did you mean {near}?" if near else ""
        raise AnswerError(f"'{answer}' is none of {self.wanted}{hint}")

    def _number(self, answer: str | int | float) -> float:
        text = str(answer).strip()
        try:
            # A decimal comma is what a good part of the world types.
            bare = float(text.replace(",", "."))
        except ValueError:
            try:
                value = quantity(text, self.unit)
            except UnitError as error:
                raise AnswerError(str(error)) from None
        else:
            value = bare * (UNITS[self.written][1] if self.written in UNITS else 1.0)
        if not isfinite(value):
            raise AnswerError(f"{text} is not a number that a rule can show")
        if not self.least <= value <= self.most:
            raise AnswerError(self._beyond(value))
        return value

    def _beyond(self, value: float) -> str:
        why = f": {self.why}" if self.why else ""
        return f"{self.shown(value)} is not between {self._bounds()}{why}"

    def _bounds(self) -> str:
        return f"{self.shown(self.least)} and {self.shown(self.most)}"

    def shown(self, value: float) -> str:
        """`value` (SI) in the unit in which a person would write it."""
        if self.written in UNITS and self.written != "%":
            return f"{value / UNITS[self.written][1]:.6g} {self.written}"
        if self.unit == "rad":
            return f"{value * 180 / pi:.6g} deg"
        return with_unit(value, self.unit)


FACING = Question(
    "geometry.facing",
    "How far is it turned from how it stood at the start, counter-clockwise?",
    unit="rad",
    written="deg",
    least=-pi,
    most=pi,
    why="more than half a turn is less the other way round",
    quantity="facing",
)
"""Where a robot looks that was to look as before: after squares, and after a spin."""
