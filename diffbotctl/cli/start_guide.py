"""The guided setup of `diffbotctl start`: chapter after chapter, to the first goal."""

from __future__ import annotations

import os
import sys
import termios
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, assert_never

import click

from diffbotctl.cli.choose_port import choose_port
from diffbotctl.cli.options import VIRTUAL_PORTS
from diffbotctl.cli.start_steps import (
    ANSWER_CODE,
    CHAPTERS,
    MESSAGES,
    OTHER_PARTS,
    Chapter,
    ChapterKey,
    headline,
    question,
    slots_question,
)
from diffbotctl.config.composed_robot import NONE
from diffbotctl.config.lookup import simulated_copy_of
from diffbotctl.errors import Problem, RunError, UsageError
from diffbotctl.printable import write_raw
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.cli.start_steps import GuideProgress
    from diffbotctl.config.configuration import RobotFile
    from diffbotctl.prompts.answers_file import AnswersFile
    from diffbotctl.prompts.question import Question

NEW_ROBOT = "my_robot"
MEASURED = ("motors", "distance", "geometry")  # steps of the calibration
UNWATCHED_MAX = "120s"  # of a drive; the longest one takes 20 s


class SetupGuide:
    """One visit: continues with the first chapter that is not done."""

    def __init__(
        self,
        progress: GuideProgress,
        robot: str | None,
        port: str | None,
        radio: str | None,
        answers: AnswersFile | None,
    ) -> None:
        self.progress, self.radio, self.stated_port = progress, radio, port
        self.prompter = GuidePrompter(answers)
        notes = progress.notes
        if robot is not None:
            self._use_robot(robot)
        if port is not None and notes.get("port") != port:
            notes["port"] = port
            self._undo_board()
        if "robot" in notes and not os.path.exists(notes["robot"]):
            del notes["robot"]  # deleted since
            self._undo_robot()
        if "port" in notes and not os.path.exists(notes["port"]):
            self._undo_board()  # unplugged since, or its name has changed
        else:
            self._note_board()

    def _use_robot(self, robot: str) -> None:
        """Continue with this robot; what was done with another one does not count."""
        from diffbotctl.config import lookup

        path = str(lookup.find_robot(robot))
        if self.progress.notes.get("robot", path) != path:
            self._undo_robot()
        self.progress.notes["robot"] = path

    def _undo_robot(self) -> None:
        """Only the chapter without a robot of one's own stays done."""
        self.progress.done[:] = [key for key in self.progress.done if key == ChapterKey.SIMULATED]

    def _note_board(self) -> None:
        """Note what kind of board is at the port.

        What was done on an emulated board does not count for a real one, nor the other way round.
        """
        from diffbotctl.drivers.robot_ports import is_simulated_port

        notes, known = self.progress.notes, (ChapterKey.SIMULATED, ChapterKey.ROBOT)
        if "port" not in notes:
            return
        kind = "emulated" if is_simulated_port(self.port) else "real"
        is_missing = kind == "emulated" and "robot" in notes and not self._results().exists()
        if notes.get("board", kind) != kind or is_missing:
            self.progress.done[:] = [key for key in self.progress.done if key in known]
        notes["board"] = kind

    def _results(self) -> Path:
        """The file for what is measured on an emulated board."""
        return simulated_copy_of(Path(self.progress.notes["robot"]))

    def _undo_board(self) -> None:
        board_keys = (ChapterKey.BOARD, ChapterKey.FIRMWARE)
        self.progress.done[:] = [key for key in self.progress.done if key not in board_keys]

    @property
    def robot(self) -> str | None:
        """The robot's file or name; None before there is one.

        On an emulated board it is the file for the results of one.
        """
        own = self.progress.notes.get("robot")
        is_emulated = own is not None and self.progress.notes.get("board") == "emulated"
        return str(self._results()) if is_emulated else own

    @property
    def port(self) -> str:
        return self.progress.notes.get("port", "a port yet to be found")

    @property
    def drive_port(self) -> str:
        """The port over which the robot drives."""
        return self.radio or self.port

    def show_status(self) -> None:
        """Print what is true now, and what comes next."""
        following = None
        for chapter in CHAPTERS:
            if chapter.key in self.progress.done:
                _print_chapter("done", chapter, self._format(chapter.truth))
            elif following is None:
                following = chapter
        if following is None:
            click.echo(self._format(MESSAGES["end"]))
        else:
            _print_chapter("next", following, following.ahead)

    def run(self) -> int:
        """Run all open chapters, or as many as possible without a board. Returns the exit code."""
        if self.progress.done:
            self.show_status()
        for chapter in CHAPTERS:
            if chapter.key in self.progress.done:
                continue
            head = headline(chapter.key)
            bold_head = click.style(head, bold=True) if sys.stdout.isatty() else head
            write_raw(sys.stdout, f"\n{bold_head}\n")
            _print(f"  next: {chapter.ahead}")
            try:
                self._run_chapter(chapter.key)
            except StopGuide as reason:
                _print(str(reason))
                return 0
            self.progress.finish(chapter.key)
            _print(f"  done: {self._format(chapter.truth)}")
        click.echo("\n" + self._format(MESSAGES["end"]))
        return 0

    def _format(self, text: str) -> str:
        return text.format(robot=self.robot, port=self.port, drive_port=self.drive_port)

    def _run_chapter(self, key: ChapterKey) -> None:
        match key:
            case ChapterKey.SIMULATED:
                self._run_pipeline("goal", "sim")
            case ChapterKey.ROBOT:
                self._make_robot_file()
            case ChapterKey.BOARD:
                self._find_board()
            case ChapterKey.FIRMWARE:
                self._flash_firmware()
            case ChapterKey.WHEELS:
                self._identify_wheels()
            case ChapterKey.MEASURE:
                self._calibrate_missing()
            case ChapterKey.METRE | ChapterKey.GOAL:
                asked = question(key)
                if not self._file().robot.sensors:
                    asked = replace(asked, text=f"{asked.text} {MESSAGES['unguarded']}")
                self.prompter.confirm(asked)
                pipeline = "goal" if key == ChapterKey.GOAL else "distance"
                self._run_pipeline(pipeline, self.drive_port)
            case _:
                assert_never(key)

    def _make_robot_file(self) -> None:
        from diffbotctl.calibrate.robot_file import writable_copy
        from diffbotctl.config import lookup
        from diffbotctl.config.load import load_robot

        own = self.progress.notes.get("robot")
        path = lookup.find_robot(own)
        if own is None and lookup.is_shipped(path):
            path = Path("robots") / f"{NEW_ROBOT}.yaml"
            if lookup.is_shipped(path):
                raise lookup.shipped_folder_error(path, "E-FILE-WRITE")
            if not path.exists():
                self._describe_robot()
        own = self.progress.notes["robot"] = str(writable_copy(path)[0])
        for warning in load_robot(own).warnings:
            click.echo(warning.render())
        _print(f"  Wiring diagram and table: diffbotctl wiring {own}")

    def _describe_robot(self) -> None:
        """Write the robot file of a kit, or of the parts that the person names."""
        from diffbotctl.cli import new

        kit_name = self.prompter.ask(question("kit"))
        if kit_name != OTHER_PARTS:
            new.write("robot", NEW_ROBOT, new.kits()[kit_name].template)
            return
        new.compose(NEW_ROBOT, self._ask_parts())
        _print("  The pins in it are a proposal: wire the robot so, or write yours.")

    def _ask_parts(self) -> dict[str, Any]:
        def ask(name: str, default: str | None = None) -> str:
            return self.prompter.ask(question(name, default))

        parts: dict[str, Any] = {"board": ask("board", self._connected_board())}
        parts |= {"driver": ask("driver"), "encoders": ask("encoders")}
        if parts["encoders"] != NONE:
            slots = self.prompter.ask(slots_question(parts["encoders"]))
            parts["slots"] = int(float(slots))
        return parts | {"sensors": (ask("sensor"),), "imu": ask("imu"), "radio": ask("radio")}

    def _connected_board(self) -> str | None:
        """The type of the only board connected, if its USB identity shows it."""
        from diffbotctl.drivers.board_ports import candidates, port_named

        ports = candidates()
        if self.stated_port is not None:
            named = port_named(self.stated_port)
            ports = [named] if named else []
        chips = [port.usb.chip for port in ports if port.usb]
        return chips[0].board if len(chips) == 1 and chips[0] else None

    def _find_board(self) -> None:
        from diffbotctl.calibrate.robot_file import simulated_copy
        from diffbotctl.drivers.board_ports import NoBoardError

        if self.stated_port is None:
            try:
                self.progress.notes["port"] = choose_port()
            except NoBoardError as error:
                if self.prompter.answers is not None or error.others:
                    raise
                raise StopGuide(MESSAGES["no_board"]) from None
        self._note_board()
        if self.progress.notes["board"] == "emulated":
            made, is_new = simulated_copy(Path(self.progress.notes["robot"]))
            if is_new:
                _print(f"  It is an emulated board: what is measured goes into {made}.")

    def _flash_firmware(self) -> None:
        from diffbotctl.cli import flash
        from diffbotctl.drivers.board_ports import OtherBoardError, WrongSignatureError
        from diffbotctl.flash.board_jobs import is_diffbot

        robot = self._file().robot
        if robot.link.protocol != "diffbot":
            raise StopGuide(self._format(MESSAGES["stock"]))
        if is_diffbot(self.port, robot):
            _print("  The board already has the diffbotctl firmware.")
            return
        _print("  The board has another firmware, which will be overwritten.")
        self.prompter.confirm(question("lifted"))
        words = ("firmware", "--port", self.port, "--robot", str(self.robot), "--yes")
        try:
            _run_command(flash.flash, *words)
        except (OtherBoardError, WrongSignatureError) as error:
            own = self.progress.notes["robot"]
            fix = f"choose the robot's board with --port, or delete {own} and start again"
            raise RunError(replace(error.problems[0], fix=fix)) from error

    def _identify_wheels(self) -> None:
        if self._file().robot.drive.polarity != "unproven":
            _print("  The robot file states that the directions are proven.")
            return
        self.prompter.confirm(question("lifted"))
        self._calibrate("encoders", rolls=0)

    def _calibrate_missing(self) -> None:
        from diffbotctl.calibrate.runner import is_done

        missing = [step for step in MEASURED if not is_done(step, self._file().robot)]
        if not missing:
            _print("  The robot file contains all results already.")
            return
        answer = self.prompter.ask(question("measure"))
        for step in missing:
            if answer == "later" or (answer == "motors" and step != "motors"):
                _print(f"  Do this later: diffbotctl calibrate {step}")
                continue
            if step == "motors":
                self.prompter.confirm(question("lifted"))
            self._calibrate(step)

    def _file(self) -> RobotFile:
        from diffbotctl.drivers.robot_ports import load_robot_at

        return load_robot_at(self.port, self.robot)

    def _calibrate(self, step: str, **settings: object) -> None:
        from diffbotctl.cli.calibrate_steps import CalibrateOptions, run

        answers = self.prompter.answers
        path = None if answers is None else answers.path
        options = CalibrateOptions(
            self.robot, self.port, 0, path, path is not None, dry_run=False, fast=False
        )
        run([step], options, **settings)

    def _run_pipeline(self, pipeline: str, port: str) -> None:
        from diffbotctl.cli import run
        from diffbotctl.engine.loop import INTERRUPTED
        from diffbotctl.messages import REACHED_UNSURE

        is_watched = sys.stdout.isatty() and self.prompter.answers is None
        words = [pipeline, "--port", port]
        words += [] if self.robot is None else ["--robot", self.robot]
        # With an answers file no person is there to resume a robot that has stopped.
        words += [] if is_watched else ["--quiet", "--for", UNWATCHED_MAX]
        words += ["--fast"] if port in VIRTUAL_PORTS and not is_watched else []
        code = _run_command(run.run, *words)
        if sys.stdin.isatty():
            termios.tcflush(sys.stdin, termios.TCIFLUSH)  # typed during the run: no answers
        if code == INTERRUPTED:
            raise click.Abort
        if code == REACHED_UNSURE:
            _print("  That is usual before the wheels are calibrated.")
        elif code:
            raise click.ClickException(
                "the goal was not reached; correct the cause stated above and start again"
            )


class GuidePrompter:
    """Asks the questions of one visit: the answers file, or the person at the terminal."""

    def __init__(self, answers: AnswersFile | None) -> None:
        self.answers = answers

    def confirm(self, question: Question) -> None:
        """Raises StopGuide if the answer is not yes."""
        if self.ask(question) != "yes":
            raise StopGuide("Do that first; `diffbotctl start` continues here.")

    def ask(self, question: Question) -> str:
        """The answer. Raises UsageError without answers file and terminal."""
        from diffbotctl.ui.terminal_prompter import TerminalPrompter

        if self.answers is not None:
            answer = self.answers.answer(question)
            _print(f"  {question.text} {answer}")
        elif sys.stdin.isatty():
            try:
                answer = TerminalPrompter().answer(question)
            except RunError as error:
                fix = "`diffbotctl start` asks again"
                raise RunError(replace(error.problems[0], code=ANSWER_CODE, fix=fix)) from None
        else:
            fix = f"give --answers FILE with a line such as {question.name}: {question.choices[0]}"
            raise UsageError(
                Problem(ANSWER_CODE, question.name, "there is no terminal to ask at", fix)
            )
        return str(answer)


class StopGuide(Exception):  # noqa: N818 - not an error
    """The guide ends here for now; nothing is wrong."""


def _print_chapter(mark: str, chapter: Chapter, text: str) -> None:
    click.echo(fold_text(f"{mark}   {headline(chapter.key)}: {text}", hang=len("done   ")))


def _print(text: str) -> None:
    click.echo(fold_text(text))


def _run_command(command: Any, *words: str) -> int:
    """Run a command as typed at the prompt. Returns its exit code."""
    return int(command.main(words, standalone_mode=False) or 0)
