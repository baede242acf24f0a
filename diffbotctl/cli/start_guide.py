"""The walk along the chapters of `diffbotctl start`: what each does, by the commands there are.

Whoever answers the questions of `diffbotctl start`: a person at the terminal, or a file.
"""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.start.guide_answers import QUESTIONS
from diffbotctl.start.steps import CHAPTERS, Chapter, headline
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from pathlib import Path

    from diffbotctl.config.configuration import RobotFile
    from diffbotctl.start.guide_answers import GuideAnswers
    from diffbotctl.start.progress import GuideProgress

NEW_ROBOT = "my_robot"
# What each further step of the calibration finds, and its file knows once it is done.
MEASURED = {
    "motors": "drive.left.motor.lag",
    "distance": "drive.left.wheel.diameter",
    "geometry": "drive.track",
}
NO_BOARD = """\
No board is plugged in. Connect a Mega 2560 with its USB cable, and start again:
the path goes on here. If one is plugged in, `diffbotctl ports` says why it is
not seen; `diffbotctl wiring` draws what else is connected to it.
Without a board, type `diffbotctl emulate` in another terminal: it makes one to
try all this on, and says which ports to give here:
    diffbotctl start --port PORT"""
STOCK = """\
{robot} says link: {{protocol: rosserial}}:
the board keeps the book's firmware. It drives as it is:
    diffbotctl run goal --robot {robot} --port {port}
This path is for ours, which stops by itself when the host falls silent. Say
link: {{protocol: diffbot}} in the file, and start again."""
END = """\
That is the whole path. From here:
    diffbotctl calibrate show        what was measured, and what was not
    diffbotctl run square --robot {robot} --port {port}
    diffbotctl why                   whenever it stands and you wonder"""


class Walk:
    """One visit: goes on from the first chapter that is not done."""

    def __init__(
        self,
        record: GuideProgress,
        robot: str | None,
        port: str | None,
        radio: str | None,
        answers: GuideAnswers | None,
    ) -> None:
        self.record, self.radio = record, radio
        self.attendant = GuidePrompter(answers)
        notes = record.notes
        if robot is not None:
            self._take(robot)
        self.given = port
        if port is not None and notes.get("port") != port:
            notes["port"] = port
            self._undo("board", "firmware")
        if "robot" in notes and not os.path.exists(notes["robot"]):
            del notes["robot"]  # deleted since: what was done with it does not count
            record.done[:] = [key for key in record.done if key == CHAPTERS[0].key]
        if "port" in notes and not os.path.exists(notes["port"]):
            self._undo("board", "firmware")  # unplugged since, or its name has changed

    def _take(self, robot: str) -> None:
        """Go on with this robot; what was done with another one does not count."""
        from diffbotctl.config import lookup

        path = str(lookup.robot(robot))
        if self.record.notes.get("robot", path) != path:
            self.record.done[:] = [key for key in self.record.done if key == CHAPTERS[0].key]
        self.record.notes["robot"] = path

    def _undo(self, *keys: str) -> None:
        self.record.done[:] = [key for key in self.record.done if key not in keys]

    @property
    def robot(self) -> str | None:
        """The robot's file or name; None until there is one."""
        return self.record.notes.get("robot")

    @property
    def port(self) -> str:
        """The board's USB port."""
        return self.record.notes.get("port", "a port yet to be found")

    def tell(self) -> Chapter | None:
        """Say what is true now, and what comes next. Returns the next chapter."""
        following = None
        for chapter in CHAPTERS:
            if chapter.key in self.record.done:
                _told("done", chapter, self._worded(chapter.truth))
            elif following is None:
                following = chapter
        if following is None:
            click.echo(END.format(robot=self.robot, port=self.radio or self.port))
        else:
            _told("next", following, following.ahead)
        return following

    def go(self) -> int:
        """Walk to the end, or as far as there is a board. Returns the exit code."""
        if self.record.done:
            self.tell()
        for chapter in CHAPTERS:
            if chapter.key in self.record.done:
                continue
            click.echo(f"\n{click.style(headline(chapter.key), bold=True)}")
            _say(f"  next: {chapter.ahead}")
            try:
                getattr(self, f"_{chapter.key}")()
            except StopGuide as why:
                _say(str(why))
                return 0
            self.record.finish(chapter.key)
            _say(f"  now: {self._worded(chapter.truth)}")
        click.echo("\n" + END.format(robot=self.robot, port=self.radio or self.port))
        return 0

    def _worded(self, text: str) -> str:
        return text.format(robot=self.robot, port=self.port)

    # --- the chapters ---

    def _simulated(self) -> None:
        self._run("goal", "sim")

    def _robot(self) -> None:
        from diffbotctl.cli import new
        from diffbotctl.config import lookup
        from diffbotctl.config.load import load_robot
        from diffbotctl.start.own_file import make_own_copy, refuse_shipped_folder

        path = lookup.robot(self.robot)
        if self.robot is None and lookup.is_shipped(path):
            own_name = Path("robots") / f"{NEW_ROBOT}.yaml"
            refuse_shipped_folder(own_name)
            if not own_name.exists():
                _say("  It is the book's kit; change what differs on yours.")
                new.write("robot", NEW_ROBOT)
            path = own_name
        self.record.notes["robot"] = str(make_own_copy(path))
        for warning in load_robot(self.robot).warnings:
            click.echo(warning.render())
        _say(f"  Its wires, as picture and table: diffbotctl wiring {self.robot}")

    def _board(self) -> None:
        from diffbotctl.cli.choose_port import choose_port
        from diffbotctl.drivers.board_errors import NoBoardError

        if self.given is None:
            try:
                self.record.notes["port"] = choose_port()
            except NoBoardError:
                if not self.attendant.is_person:
                    raise
                raise StopGuide(NO_BOARD) from None

    def _firmware(self) -> None:
        from diffbotctl.board.session import is_diffbot
        from diffbotctl.cli import flash

        if self._file().robot.link.protocol != "diffbot":
            raise StopGuide(STOCK.format(robot=self.robot, port=self.radio or self.port))
        if is_diffbot(self.port, self._file().robot):
            _say("  It runs our firmware already: nothing to write.")
            return
        _say("  It does not run our firmware. What is on it now will be written over.")
        self.attendant.agree("lifted")
        words = ("firmware", "--port", self.port, "--robot", str(self.robot), "--yes")
        _typed(flash.flash, *words)

    def _wheels(self) -> None:
        if self._file().robot.drive.polarity != "unproven":
            _say("  Its file says that this was seen before.")
            return
        self.attendant.agree("lifted")
        self._calibrate("encoders", rolls=0)

    def _measure(self) -> None:
        left = [step for step, field in MEASURED.items() if not self._is_known(field)]
        if not left:
            _say("  Its file says that all of it was measured before.")
            return
        answer = self.attendant.ask("measure")
        for step in left:
            if answer == "later" or (answer == "motors" and step != "motors"):
                _say(f"  Later, then: diffbotctl calibrate {step}")
                continue
            self.attendant.agree("lifted" if step == "motors" else "floor")
            self._calibrate(step)

    def _metre(self) -> None:
        self.attendant.agree("floor")
        self._run("distance", self.radio or self.port)

    def _goal(self) -> None:
        self.attendant.agree("floor")
        _say("  Put it back to where it started from, if you like it to end up there.")
        self._run("goal", self.radio or self.port)

    # --- what they share ---

    def _file(self) -> RobotFile:
        from diffbotctl.config.load import load_robot

        return load_robot(self.robot)

    def _is_known(self, field: str) -> bool:
        return field in self._file().robot.calibration

    def _calibrate(self, step: str, **settings: object) -> None:
        from diffbotctl.cli.calibrate_steps import CalibrateOptions, run

        answers = self.attendant.file
        wanted = CalibrateOptions(self.robot, self.port, 0, answers, answers is not None, False)
        run([step], wanted, **settings)

    def _run(self, pipeline: str, port: str) -> None:
        from diffbotctl.cli import run

        watched = sys.stdout.isatty() and self.attendant.is_person
        words = [pipeline, "--port", port]
        words += [] if self.robot is None else ["--robot", self.robot]
        words += [] if watched else ["--fast", "--quiet"]
        code = _typed(run.command, *words)
        if code:
            raise click.ClickException("it did not get there; start again when that is mended")


def _told(state: str, chapter: Chapter, text: str) -> None:
    click.echo(fold_text(f"{state}   {headline(chapter.key)}: {text}", hang=len("done   ")))


def _say(text: str) -> None:
    """Words of the path itself, between what its commands print."""
    click.echo(fold_text(text))


def _typed(command: Any, *words: str) -> int:
    """A command's own function, as typed at the prompt. Returns its exit code."""
    return int(command.main(words, standalone_mode=False) or 0)


class StopGuide(Exception):  # noqa: N818 - no error
    """The walk ends here for now, and nothing is wrong."""


class GuidePrompter:
    """Asks each question of one visit where it has to be asked."""

    def __init__(self, answers: GuideAnswers | None) -> None:
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
            raise StopGuide("Then do that first; `diffbotctl start` goes on here.")
        self._agreed.add(name)

    def ask(self, name: str) -> str:
        """The answer to the question called `name`. Raises UsageError when nobody answers."""
        from diffbotctl.errors import Problem, UsageError

        question = QUESTIONS[name]
        if self._answers is not None:
            answer = self._answers.answer(question)
            click.echo(fold_text(f"  {question.text} {answer}"))
            return answer
        if not sys.stdin.isatty():
            fix = f"give --answers FILE with a line such as {name}: {question.choices[0]}"
            raise UsageError(Problem("E-START-ANSWER", name, "nobody is there to be asked", fix))
        found: str = click.prompt(
            fold_text(f"  {question.text} ({', '.join(question.choices)})"),
            value_proc=partial(_chosen, question.choices),
        )
        return found


def _chosen(choices: tuple[str, ...], typed: str) -> str:
    """The choice that begins like what was typed. Raises BadParameter for none, or several."""
    from diffbotctl.errors import join_words

    word = typed.strip().lower()
    begun = [each for each in choices if word and each.startswith(word)]
    if len(begun) != 1:
        raise click.BadParameter(f"answer {join_words(choices)}")
    return begun[0]
