"""Questions and requests to the person at the terminal."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

import click

from diffbotctl.errors import WIDTH, Problem, RunError
from diffbotctl.prompts.question import AnswerError
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.prompts.answers_file import MeasuringTools
    from diffbotctl.prompts.keyboard import Keyboard
    from diffbotctl.prompts.question import Answer, ManualAction, MarkFloor, MotionNotice, Question

ANY_KEY = "Any key stops the robot. Press Enter to start"
WHEN_READY = "Press Enter when you are ready:"
ANSWER_ATTEMPTS_MAX = 5
PROMPT_END = ": "
CONSENTS = ("", "y")  # Enter or y; no other text may start a motor
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
    answers.
    """

    def __init__(
        self,
        keyboard: Keyboard | None = None,
        tools: MeasuringTools | None = None,
    ) -> None:
        self.keyboard = keyboard
        self.tools = tools

    def confirm_motion(self, notice: MotionNotice) -> None:
        """Wait for Enter or y. Raises RunError if the person refuses."""
        self._consent(f"{ANY_KEY}, or type no")
        if self.tools is not None:
            self.tools.raise_wheels(notice.is_raised)

    def mark_floor(self, mark: MarkFloor) -> None:
        """Wait for Enter or y: the robot moves next. Raises RunError if the person refuses."""
        self._consent(f"{WHEN_READY} {mark.motion}; any key stops it")
        if self.tools is not None:
            self.tools.mark()

    def act(self, action: ManualAction) -> None:
        """Wait until it is done. Raises RunError if the person refuses."""
        if self.tools is None or not action.can_be_simulated:
            self._consent("Press Enter when it is done")
            return
        self._consent("SIMULATED: press Enter, and the simulator does it")
        action.simulate(self.tools)

    def _consent(self, text: str) -> None:
        """Wait for Enter or y; other text is asked again. Raises RunError on a refusal."""
        text = fold_text(text, width=WIDTH - len(PROMPT_END))
        for _ in range(ANSWER_ATTEMPTS_MAX):
            typed = self._type(text).strip().lower()
            if typed in CONSENTS:
                return
            if typed in REFUSALS:
                break
            click.echo(fold_text("Nothing moves: only Enter or y continues, no ends this step."))
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
        # Folded with the default: the terminal would break the line in the middle of it.
        offered = f" [{default}]" if default else ""
        text = f"{question.text} ({question.expected}){offered}"
        text = fold_text(text, hang=2, width=WIDTH - len(PROMPT_END))
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
            typed: str = click.prompt(
                text, default=default, show_default=False, prompt_suffix=PROMPT_END
            )
        return typed
