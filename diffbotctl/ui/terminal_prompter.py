"""Questions and requests to the person at the terminal."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

import click

from diffbotctl.errors import Problem, RunError
from diffbotctl.prompts.question import AnswerError
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.prompts.keyboard import Keyboard
    from diffbotctl.prompts.question import Answer, ManualAction, MarkFloor, MotionNotice, Question

ANY_KEY = "Any key stops the robot. Press Enter to start"
ANSWER_ATTEMPTS_MAX = 5


class TerminalPrompter:
    """A prompter at a terminal. `agreed`: motions need no further consent (--yes)."""

    def __init__(self, keyboard: Keyboard | None = None, agreed: bool = False) -> None:
        self.keyboard = keyboard
        self.agreed = agreed

    def confirm_motion(self, notice: MotionNotice) -> None:
        """Wait for Enter. Raises RunError if the person refuses."""
        if self.agreed:
            return
        typed = self._type(f"{ANY_KEY}, or type no")
        if typed.strip().lower() in ("n", "no", "q", "quit"):
            raise RunError(
                Problem("E-CALIBRATE-STOPPED", "calibrate", "the motion was refused", "")
            )

    def mark_floor(self, mark: MarkFloor) -> None:
        """Wait until it is marked."""
        self._type("Press Enter when you are ready")

    def act(self, action: ManualAction) -> None:
        """Wait until it is done."""
        self._type("Press Enter when it is done")

    def answer(self, question: Question) -> Answer:
        """A valid answer; an invalid one is followed by the reason and the same question.

        Raises RunError after too many invalid answers.
        """
        reason = ""
        text = fold_text(f"{question.text} ({question.expected})", hang=2)
        default = "" if question.default is None else str(question.default)
        for _ in range(ANSWER_ATTEMPTS_MAX):
            try:
                return question.parse(self._type(text, default))
            except AnswerError as error:
                reason = str(error)
                click.echo(fold_text(f"Invalid: {reason}", hang=2))
        fix = "measure, then run this step again"
        raise RunError(Problem("E-CALIBRATE-ANSWER", question.name, reason, fix))

    def _type(self, text: str, default: str = "") -> str:
        """A line of text; while it is typed, keys do not stop the robot."""
        with nullcontext() if self.keyboard is None else self.keyboard.resting():
            typed: str = click.prompt(text, default=default, show_default=bool(default))
        return typed
