"""Time from a fresh clone to the first goal: simulated, and on an emulated board by `start`.

The Debian packages (python3-venv; for the emulator gcc, libsimavr-dev and arduino-core-avr) are
installed already. The time includes the virtual environment and the build of the emulator.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from diffbotctl.cli.start_steps import QUESTIONS
from diffbotctl.prompts.question import Question
from tests.support.trials.row import Row
from tests.support.virtual_board import START_ANSWERS, outcome

ROOT = Path(__file__).parent.parent
TIME_MAX_S = 120.0  # on two cores
CHOICE = "measure"  # of the person, each time that `start` is called
COMMAND_TIMEOUT_S = 600.0


class Newcomer:
    """A user with a fresh clone, an empty folder, and no state or cache of an earlier run."""

    def __init__(self, place: Path) -> None:
        self.clone, self.folder = place / "clone", place / "robot"
        self.folder.mkdir()
        (self.folder / "answers.yaml").write_text(START_ANSWERS)
        homes = {f"XDG_{kind}_HOME": str(place / kind.lower()) for kind in ("STATE", "CACHE")}
        self.environment = os.environ | homes
        self.environment.pop("PYTHONPATH", None)

    def run(self, *words: object, at: Path | None = None) -> str:
        """The output of a command, whether it fails or not; a failure shows in the figures."""
        process = subprocess.Popen(
            [str(word) for word in words],
            cwd=at or self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        _, answer = outcome(process, cwd=self.folder, env=self.environment)
        return answer

    @property
    def program(self) -> Path:
        """diffbotctl of the clone."""
        return self.clone / ".venv/bin/diffbotctl"

    @contextmanager
    def blank_board(self) -> Iterator[list[str]]:
        """An emulated board without a program; the command-line options that name its ports."""
        words = [str(self.program), "emulate", "my_robot", "--blank"]
        board = subprocess.Popen(
            words, cwd=self.folder, env=self.environment, stdout=subprocess.PIPE, text=True
        )
        try:
            assert board.stdout is not None
            ports: dict[str, str] = {}
            while len(ports) < 2 and (line := board.stdout.readline()):
                ports.update(re.findall(r"^(USB|radio) port +(\S+)", line))
            yield ["--port", ports["USB"], "--radio", ports["radio"]]
        finally:
            board.send_signal(signal.SIGINT)
            board.wait(COMMAND_TIMEOUT_S)


def rows() -> Iterator[Row]:
    """First the simulated goal, then the one of the board, then `start` again with all files."""
    with TemporaryDirectory(prefix="diffbot-newcomer-") as place:
        newcomer = Newcomer(Path(place))
        start = time.monotonic()
        newcomer.run("git", "clone", "-q", "--no-local", ROOT, newcomer.clone)
        newcomer.run("make", ".venv/installed", at=newcomer.clone)
        output = newcomer.run(newcomer.program, "start", "--answers", "answers.yaml")
        yield _row("fresh clone to the first simulated goal", start, output, 1)
        with newcomer.blank_board() as ports:
            words = (newcomer.program, "start", *ports, "--answers", "answers.yaml")
            output = newcomer.run(*words)
            yield _row("and to an emulated board's, through start", start, output, 2)
            again = newcomer.run(*words, "--again")
        first_questions, questions = asked(output), asked(again)
        unnecessary = [
            each.name for each in questions if not each.is_consent and each.name != CHOICE
        ]
        yield Row(
            "questions that the files answer already",
            f"{len(unnecessary)} of {len(questions)} asked, of {len(first_questions)} at first",
            "0, but for consent before each drive, and whether to calibrate now",
            not unnecessary and bool(first_questions),
        )


def asked(output: str) -> list[Question]:
    """The questions in the output of `start`, whatever its line breaks."""
    words = " ".join(output.split())
    return [
        question
        for question in QUESTIONS
        for _ in range(words.count(" ".join(question.text.split())))
    ]


def _row(what: str, start: float, output: str, goals: int) -> Row:
    seconds = time.monotonic() - start
    reached = output.count("1 of 1 reached")
    met = seconds <= TIME_MAX_S and reached == goals
    return Row(what, f"{seconds:.0f} s, {reached} reached", f"<= {TIME_MAX_S:.0f} s, {goals}", met)
