"""Questions and requests to the person at the terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from typing import TYPE_CHECKING

import click

from diffbotctl.errors import WIDTH, Problem, RunError, join_words
from diffbotctl.printable import write_raw
from diffbotctl.prompts.question import AnswerError
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from diffbotctl.prompts.answers_file import MeasuringTools
    from diffbotctl.prompts.keyboard import Keyboard
    from diffbotctl.prompts.question import Answer, ManualAction, MarkFloor, MotionNotice, Question

ANY_KEY = "Any key stops the robot. Press Enter to start"
ALLOWED = "Any key stops the robot while it moves."
MOVING = "The robot moves; any key stops it."
WHEN_READY = "Press Enter when you are ready:"
AFTER_STOP = "To repeat it type y and Enter:"
ANSWER_ATTEMPTS_MAX = 5
PROMPT_END = ": "
CONSENTS = ("", "y")  # Enter or y; no other text may start a motor
STRICT_CONSENTS = (
    "y",
    "yes",
)  # after a key has stopped it, which may have been pressed several times
# What a person would measure with, and what it does.
INSTRUMENTS = {
    "forward": "tape reads",
    "left": "tape reads",
    "distance": "tape reads",
    "facing": "protractor reads",
    "gap": "ruler reads",
    "battery": "meter reads",
    "wheel": "eye sees:",
}
REFUSALS = ("n", "no", "q", "quit", "stop")


class TerminalPrompter:
    """A prompter at a terminal.

    `tools`: of a simulated robot; they do what a hand would do, and their readings are offered as
    answers. With `is_fast` it is not asked what they can do or read.
    """

    def __init__(
        self,
        keyboard: Keyboard | None = None,
        tools: MeasuringTools | None = None,
        is_fast: bool = False,
    ) -> None:
        self.keyboard = keyboard
        self.tools = tools
        self.is_fast = is_fast and tools is not None  # a real robot waits for each consent

    def confirm_motion(self, notice: MotionNotice) -> None:
        """Wait for Enter or y. Raises RunError if the person refuses."""
        self._consent(f"{ANY_KEY}, or type no", instead=ALLOWED)
        if self.tools is not None:
            self.tools.raise_wheels(notice.is_raised)

    def mark_floor(self, mark: MarkFloor) -> None:
        """Wait for Enter or y: the robot moves next. Raises RunError if the person refuses."""
        lead = AFTER_STOP if mark.is_repeated else WHEN_READY
        valid = STRICT_CONSENTS if mark.is_repeated else CONSENTS
        self._consent(f"{lead} {mark.motion}; any key stops it", valid, MOVING)
        if self.tools is not None:
            self.tools.mark()

    def act(self, action: ManualAction) -> None:
        """Wait until it is done. Raises RunError if the person refuses."""
        if self.tools is None or not action.can_be_simulated:
            self._consent("Press Enter when it is done")
            return
        self._consent("SIMULATED: press Enter, and the simulator does it")
        action.simulate(self.tools)

    def _consent(self, text: str, valid: Sequence[str] = CONSENTS, instead: str = "") -> None:
        """Wait for one of `valid`; other text is asked again. Raises RunError on a refusal.

        `instead`: takes the question's place on the screen once the robot may move, so that no one
        answers it again.
        """
        if self.is_fast and valid == CONSENTS:
            return
        text = fold_text(text, width=WIDTH - len(PROMPT_END))
        for _ in range(ANSWER_ATTEMPTS_MAX):
            typed = self._type(text).strip().lower()
            if typed in valid:
                if instead:
                    _replace_lines(text.count("\n") + 1, instead)
                return
            if typed in REFUSALS:
                break
            keys = join_words(["Enter" if word == "" else word for word in valid])
            click.echo(fold_text(f"Nothing moves: only {keys} continues, no ends this step."))
        raise RunError(Problem("E-CALIBRATE-STOPPED", "calibrate", "the motion was refused", ""))

    def answer(self, question: Question) -> Answer:
        """A valid answer; an invalid one is followed by the reason and the same question.

        Raises RunError after too many invalid answers.
        """
        reason = ""
        default = "" if question.default is None else question.format_answer(question.default)
        reading = "" if self.tools is None else self.tools.offer(question)
        if reading:
            click.echo(fold_text(f"SIMULATED: the {INSTRUMENTS[question.quantity]} {reading}"))
            default = reading
            if self.is_fast:
                return question.parse(reading)
        # Folded with the default: the terminal would break the line in the middle of it.
        offered = f" [{default}]" if default else ""
        expected = "number or name" if question.is_listed else question.expected
        text = f"{question.text} ({expected}){offered}"
        if question.is_listed:
            click.echo("\n".join(_choice_rows(question)))
        text = fold_text(text, hang=2, width=WIDTH - len(PROMPT_END))
        for _ in range(ANSWER_ATTEMPTS_MAX):
            try:
                return question.parse(question.numbered(self._type(text, default).strip()))
            except AnswerError as error:
                reason = str(error)
                click.echo(fold_text(f"Invalid: {reason}", hang=2))
        fix = "measure, then run this step again"
        raise RunError(Problem("E-CALIBRATE-ANSWER", question.name, reason, fix))

    def _type(self, text: str, default: str = "") -> str:
        """A line of text; while it is typed, keys do not stop the robot."""
        with nullcontext() if self.keyboard is None else self.keyboard.resting():
            typed: str = click.prompt(
                text, default=default, show_default=False, prompt_suffix=PROMPT_END
            )
        return typed


def _choice_rows(question: Question) -> Iterator[str]:
    """The choices with their numbers: one a row with its label, or as many as fit."""
    width = max(map(len, question.choices))
    cells = [f"{n:>4} {choice:<{width}}" for n, choice in enumerate(question.choices, 1)]
    if question.labels:
        for cell, label in zip(cells, question.labels, strict=True):
            yield f"{cell}  {label}".rstrip()
        return
    across = max(WIDTH // len(cells[0]), 1)
    for begin in range(0, len(cells), across):
        yield "".join(cells[begin : begin + across]).rstrip()


def _replace_lines(count: int, text: str) -> None:
    """Replace the last `count` lines of a terminal; below them where lines may have wrapped."""
    is_able = sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"
    if is_able and os.get_terminal_size(sys.stdout.fileno()).columns >= WIDTH:
        write_raw(sys.stdout, f"\x1b[{count}A\x1b[J")
    click.echo(text)
