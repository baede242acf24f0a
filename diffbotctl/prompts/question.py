"""What a person beside the robot is asked to answer, allow or do."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, pi
from typing import Literal, NamedTuple, Protocol

from diffbotctl.errors import closest_match, join_words
from diffbotctl.params import with_unit
from diffbotctl.units import UNITS, UnitError, quantity

Answer = float | str
MeasuredQuantity = Literal["", "forward", "left", "distance", "facing", "gap", "battery", "wheel"]

LISTED_MIN = 4  # choices; more are not taken in within a sentence


class AnswerError(ValueError):
    """An answer that is not valid. Its text is the reason."""


class MotionNotice(NamedTuple):
    """What moves next, and how far. Nothing moves before the person agrees.

    `step` is the name of the step, whose question `motion_consent` an answers file must answer.
    The session enforces `turns` and `reach` afterwards: exceeding them stops the robot.
    """

    step: str
    text: str
    turns: float | None = None  # maximum for each wheel; the wheels are off the ground
    reach: float | None = None
    """m; maximum distance of the middle of the axle from its present position"""
    watched: bool = True  # whether the encoder counts are reliable enough to enforce the limit

    @property
    def is_raised(self) -> bool:
        """Whether the wheels are off the ground."""
        return self.turns is not None


class MarkFloor(NamedTuple):
    """A request to mark the floor at both wheels and the front: readings are taken from the mark.

    For questions that are answered by eye, the mark is on the wheels. The robot moves as soon as
    the person is ready.
    """

    text: str
    motion: str  # what moves then, and how far, such as `it drives 1 m straight ahead`
    is_placed: bool = True  # whether a person puts the robot somewhere, or marks the floor
    is_repeated: bool = False
    """whether a key has stopped this motion: another press of Enter must not start it"""


class Hands(Protocol):
    """Moves a simulated robot, as a person would."""

    def roll(self, wheel: str, turns: float) -> None: ...
    def place(self, sensor: str, distance: float) -> None: ...
    def lift(self, side: str, angle: float) -> None: ...


class ManualAction(NamedTuple):
    """An action that only a person can do. The step waits until it is done.

    `roll` is the wheel to turn (`left` or `right`) and the number of turns; `place` is the sensor
    and the distance (m) at which to put an object in front of it; `lift` is the side to lift
    (`front` or `left`) and the angle (rad) to the floor at which to hold it, 0 to put it down.
    Simulated tools read these three.
    """

    name: str
    text: str
    roll: tuple[str, float] | None = None
    place: tuple[str, float] | None = None
    lift: tuple[str, float] | None = None

    @property
    def can_be_simulated(self) -> bool:
        """Whether simulated tools can do it."""
        return any(what is not None for what in (self.roll, self.place, self.lift))

    def simulate(self, hands: Hands) -> None:
        """Do it with a simulated robot."""
        if self.roll is not None:
            hands.roll(*self.roll)
        if self.place is not None:
            hands.place(*self.place)
        if self.lift is not None:
            hands.lift(*self.lift)


@dataclass(frozen=True, slots=True)
class Question:
    """One question. An answers file answers it by its `name`, such as `distance.reading`."""

    name: str
    text: str  # what to measure or observe, and how
    unit: str = ""  # SI unit of a number (`m`, `rad`, `V`, `1`); empty for a choice
    default_unit: str = ""  # unit of a number without one, such as `mm`
    minimum: float = -inf
    maximum: float = inf
    limit_reason: str = ""  # why no valid answer is outside of `minimum` and `maximum`
    choices: tuple[str, ...] = ()
    quantity: MeasuredQuantity = ""  # quantity that a simulated tool measures for this question
    labels: tuple[str, ...] = ()
    """what each of the choices is, for a list of them; empty where their names say it"""
    default: Answer | None = None  # answer for an empty line
    is_whole: bool = False  # whether only a whole number is valid
    is_repeated: bool = False
    """whether the last answer was contradicted; an answers file gives the same again"""
    is_consent: bool = False
    """whether a real robot moves after it; only an entry with its whole name answers it"""

    def parse(self, answer: object) -> Answer:
        """The answer as a number in SI or a choice. Raises AnswerError with the reason."""
        if answer is None or (isinstance(answer, str) and not answer.strip()):
            if self.default is None:
                raise AnswerError(f"an answer is required: {self.expected}")
            return self.default
        if isinstance(answer, bool) or not isinstance(answer, str | int | float):
            raise AnswerError(f"{answer!r} is not an answer: {self.expected}")
        return self._parse_choice(str(answer)) if self.choices else self._parse_number(str(answer))

    @property
    def expected(self) -> str:
        """What a valid answer looks like."""
        if self.choices:
            return join_words(self.choices, "or")
        return f"a number in {self.default_unit}" if self.default_unit else "a number"

    def format_answer(self, answer: Answer) -> str:
        """The answer as a person would write it: a choice, or a number with its unit."""
        if isinstance(answer, str):
            return answer
        scale = UNITS[self.default_unit][1] if self.default_unit in UNITS else 1.0
        digits = 0 if self.is_whole else 2 if self.default_unit in ("V", "cm") else 1
        return f"{answer / scale:.{digits}f} {self.default_unit}".strip()

    @property
    def is_listed(self) -> bool:
        """Whether a person is shown a numbered list of the choices, and may type a number."""
        return len(self.choices) > LISTED_MIN

    def numbered(self, typed: str) -> str:
        """The choice whose number was typed; other text as it is."""
        number = int(typed) if typed.isdecimal() else 0
        is_number = self.is_listed and 1 <= number <= len(self.choices)
        return self.choices[number - 1] if is_number else typed

    def _parse_choice(self, answer: str) -> str:
        word = answer.strip().lower()
        if word in self.choices:
            return word
        candidates = [choice for choice in self.choices if choice.startswith(word)]
        if len(candidates) == 1:
            return candidates[0]
        near = closest_match(word, self.choices)
        hint = f"; did you mean {near}?" if near else ""
        raise AnswerError(f"'{answer}' is not valid; answer {self.expected}{hint}")

    def _parse_number(self, answer: str) -> float:
        text = answer.strip()
        try:
            # Many locales write a decimal comma.
            value = float(text.replace(",", ".")) * UNITS.get(self.default_unit, ("", 1.0))[1]
        except ValueError:
            try:
                value = quantity(text, self.unit)
            except UnitError as error:
                raise AnswerError(str(error)) from None
        if not isfinite(value):
            raise AnswerError(f"{text} is not a finite number")
        if self.is_whole and value != round(value):
            raise AnswerError(f"{text} is not a whole number")
        if not self.minimum <= value <= self.maximum:
            limits = f"between {self._format(self.minimum)} and {self._format(self.maximum)}"
            if self.minimum == self.maximum:
                limits = self._format(self.minimum)
            reason = f": {self.limit_reason}" if self.limit_reason else ""
            raise AnswerError(f"{self._format(value)} is not {limits}{reason}")
        return value

    def _format(self, value: float) -> str:
        """`value` (SI) in the unit that a person would write."""
        if self.default_unit in UNITS and self.default_unit != "%":
            return f"{value / UNITS[self.default_unit][1]:.6g} {self.default_unit}"
        if self.unit == "rad":
            return f"{value * 180 / pi:.6g} deg"
        return with_unit(value, self.unit)


def motion_consent(step: str) -> Question:
    """The question whether the robot may move as the step called `step` announces."""
    text = "May the robot move as this step announces?"
    return Question(f"{step}.motion", text, choices=("yes", "no"), is_consent=True)


class ExpectedQuestion(NamedTuple):
    """A question, or something for a hand to do, that a step will ask for."""

    what: Question | ManualAction
    times: int = 1  # at least; 0: perhaps


def floor_drives(step: str, times: int) -> list[ExpectedQuestion]:
    """What a person does for the drives of the step called `step`, beside answering."""
    start = ManualAction(f"{step}.start", "Put the robot at its start before each drive.")
    return [ExpectedQuestion(motion_consent(step)), ExpectedQuestion(start, times)]


class Prompter(Protocol):
    """Puts requests to the person beside the robot, or answers them from a file."""

    def confirm_motion(self, notice: MotionNotice) -> None:
        """Wait until the robot may move. Raises RunError if it must not."""

    def mark_floor(self, mark: MarkFloor) -> None:
        """Wait until the floor is marked where the robot stands."""

    def act(self, action: ManualAction) -> None:
        """Wait until the action is done. Raises RunError if it cannot be done."""

    def answer(self, question: Question) -> Answer:
        """A valid answer. Raises RunError if there is none."""
