"""The person beside the robot: reads, agrees, measures, types."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

import click

from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from diffbotctl.calibrate.step import ManualAction, MarkFloor, MotionNotice
    from diffbotctl.prompts.keyboard import Keyboard
    from diffbotctl.prompts.question import Answer, Question

ANY_KEY = "Any key stops it. Press Enter to begin"


class TerminalPrompter:
    """An attendant at a terminal. `agreed`: movements need no consent any more (--yes)."""

    def __init__(self, keyboard: Keyboard | None, agreed: bool) -> None:
        self.keyboard = keyboard
        self.agreed = agreed

    def agree(self, announced: MotionNotice) -> None:
        """Wait for Enter. Raises RunError when the person does not want it."""
        from diffbotctl.errors import Problem, RunError

        if self.agreed:
            return
        with self._typing():
            said = click.prompt(f"{ANY_KEY}, or type no", default="", show_default=False)
        if said.strip().lower() in ("n", "no", "q", "quit"):
            raise RunError(Problem("E-CALIBRATE-STOPPED", "calibrate", "you did not want it", ""))

    def mark(self, mark: MarkFloor) -> None:
        """Wait until it is made."""
        self._wait("Press Enter when you are ready")

    def act(self, act: ManualAction) -> None:
        """Wait until it is done."""
        self._wait("Press Enter when it is done")

    def answer(self, question: Question, trouble: str) -> Answer:
        """What is typed. Raises AnswerError with the reason when it is of no use."""
        if trouble:
            click.echo(fold_text(f"No: {trouble}", hang=2))
        hint = f" ({question.wanted})"
        default = "" if question.default is None else str(question.default)
        with self._typing():
            typed = click.prompt(
                fold_text(question.text + hint, hang=2), default=default, show_default=bool(default)
            )
        return question.read(typed)

    def _wait(self, text: str) -> None:
        with self._typing():
            click.prompt(text, default="", show_default=False)

    def _typing(self) -> AbstractContextManager[None]:
        return nullcontext() if self.keyboard is None else self.keyboard.resting()
