"""From a fresh clone to the first goal: simulated, and on an emulated board through `start`.

What Debian brings (python3-venv, and for the emulator gcc, libsimavr-dev and arduino-core-avr) is
there already; the rest, the virtual environment and the emulator's build too, is in the figure.
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

from diffbotctl.start.steps import QUESTIONS
from diffbotctl.testing.trials.row import Row, printed

ROOT = Path(__file__).parent.parent
TARGET = 120.0  # s on two cores
EACH_TIME = ("floor", "measure")  # what no file knows
LONGEST = 600.0  # s after which something hangs
ANSWERS = """\
lifted: yes
encoders.wheel: [left forward, right forward]
encoders.proof: both forward
measure: later
floor: yes
"""


class Newcomer:
    """Somebody with a fresh clone and an empty folder, whom no earlier visit left anything."""

    def __init__(self, place: Path) -> None:
        self.clone, self.folder = place / "clone", place / "robot"
        self.folder.mkdir()
        (self.folder / "answers.yaml").write_text(ANSWERS)
        homes = {f"XDG_{kind}_HOME": str(place / kind.lower()) for kind in ("STATE", "CACHE")}
        self.environment = os.environ | homes
        self.environment.pop("PYTHONPATH", None)

    def types(self, *words: str | Path, at: Path | None = None) -> str:
        """What a command said, failed or not: the figures tell."""
        done = subprocess.run(
            [str(word) for word in words],
            cwd=at or self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=LONGEST,
        )
        return done.stdout

    @property
    def program(self) -> Path:
        """The clone's own diffbotctl."""
        return self.clone / ".venv/bin/diffbotctl"

    @contextmanager
    def blank_board(self) -> Iterator[list[str]]:
        """An emulated board with nothing on it; the words that name its ports."""
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
            board.wait(LONGEST)


def rows() -> Iterator[Row]:
    """To the simulated goal, on to the board's, and once more when the files know it all."""
    with TemporaryDirectory(prefix="diffbot-newcomer-") as place:
        newcomer = Newcomer(Path(place))
        begun = time.monotonic()
        newcomer.types("git", "clone", "-q", "--no-local", ROOT, newcomer.clone)
        newcomer.types("make", ".venv/installed", at=newcomer.clone)
        said = newcomer.types(newcomer.program, "start")
        yield _row("fresh clone to the first simulated goal", begun, said, 1)
        with newcomer.blank_board() as ports:
            words = (newcomer.program, "start", *ports, "--answers", "answers.yaml")
            said = newcomer.types(*words)
            yield _row("and to an emulated board's, through start", begun, said, 2)
            again = newcomer.types(*words, "--again")
        needless = [name for name in asked(again) if name not in EACH_TIME]
        figure = f"{len(needless)} of {len(asked(again))} asked, of {len(asked(said))} at first"
        target = "0 needless: only floor and measure are no file's"
        yield Row(
            "questions that the files answer already",
            figure,
            target,
            not needless and bool(asked(said)),
        )


def asked(said: str) -> list[str]:
    """The names of the questions in what `start` said, however it was folded."""
    words = " ".join(said.split())
    return [
        question.name
        for question in QUESTIONS
        for _ in range(words.count(" ".join(question.text.split())))
    ]


def _row(what: str, begun: float, said: str, goals: int) -> Row:
    seconds = time.monotonic() - begun
    reached = said.count("1 of 1 reached")
    met = seconds <= TARGET and reached == goals
    return Row(what, f"{seconds:.0f} s, {reached} reached", f"<= {TARGET:.0f} s, {goals}", met)


if __name__ == "__main__":
    raise SystemExit(printed(rows()) > 0)
