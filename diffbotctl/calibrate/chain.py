"""Runs steps: draws their events, has their questions answered, and keeps what they recorded."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

from diffbotctl.calibrate.answers import Attendant
from diffbotctl.calibrate.findings import Origin
from diffbotctl.calibrate.listing import stamp
from diffbotctl.calibrate.logs import fingerprint
from diffbotctl.calibrate.question import Answer, AnswerError, Question
from diffbotctl.calibrate.rig import Rig
from diffbotctl.calibrate.step import (
    Act,
    Announce,
    Drawing,
    Event,
    Graph,
    Mark,
    Outcome,
    Progress,
    Said,
    Step,
)
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Encoders

PATIENCE = 5  # answers of no use, until a question is given up
SECONDS = 1e-9


class Screen(Protocol):
    """Draws what happens."""

    def say(self, text: str) -> None: ...
    def progress(self, progress: Progress) -> None: ...
    def draw(self, drawing: Drawing | Graph) -> None: ...


@dataclass(frozen=True, slots=True)
class Done:
    """A step that was finished, and where its findings come from."""

    outcome: Outcome
    origin: Origin
    files: Sequence[Path]
    """recording and pictures"""


def perform(step: Step, rig: Rig, attendant: Attendant, screen: Screen) -> Outcome:
    """Run one step to its end; the robot stands still afterwards, however it ended.

    The rig goes on with what was found. Raises RunError when the step failed or was stopped,
    ConfigurationError when what it found is not plausible.
    """
    running = step.run(rig)
    sent: Any = None
    try:
        while True:
            event = running.send(sent)
            sent = _obey(event, rig, attendant, screen)
    except StopIteration as end:
        outcome: Outcome = end.value
        if outcome.findings:
            rig.attempt(outcome.findings)
        return outcome
    finally:
        running.close()
        rig.allow(None)
        rig.driver.stop(rig.now)


def _obey(event: Event, rig: Rig, attendant: Attendant, screen: Screen) -> Any:
    if isinstance(event, Question):
        return asked(event, attendant)
    if isinstance(event, Announce):
        screen.say(event.text)
        attendant.agree(event)
        rig.allow(event.turns if event.watched else None)
    elif isinstance(event, Mark):
        screen.say(event.text)
        attendant.mark(event)
    elif isinstance(event, Act):
        screen.say(event.text)
        rig.allow(None)  # what a hand turns was not announced
        attendant.act(event)
    elif isinstance(event, Said):
        screen.say(event.text)
    elif isinstance(event, Progress):
        screen.progress(event)
    else:
        screen.draw(event)
    return None


def asked(question: Question, attendant: Attendant) -> Answer:
    """The answer to a question that is asked again, with the reason, until it is one.

    Raises RunError when that does not come about.
    """
    trouble = ""
    for _ in range(PATIENCE):
        try:
            return attendant.answer(question, trouble)
        except AnswerError as error:
            trouble = str(error)
    fix = "measure first, then run this step again"
    raise RunError(Problem("E-CALIBRATE-ANSWER", question.name, trouble, fix))


def kept(step: Step, outcome: Outcome, rig: Rig, folder: Path) -> Done:
    """Write the step's recording and pictures into `folder`. Raises RunError when it cannot."""
    now = datetime.now(UTC)
    begins = f"{step.name}-{now:%Y%m%d-%H%M%S}"
    rows, rig.recording = rig.recording, []
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        recording = _free(folder, begins, ".csv")
        recording.write_text(table(rows))
        files.append(recording)
        for name, text in outcome.pictures.items():
            picture = recording.with_name(f"{recording.stem}-{name}")
            picture.write_text(text)
            files.append(picture)
    except OSError as error:
        raise _unwritable(folder, error) from error
    origin = Origin(outcome.method, stamp(now), outcome.volts, fingerprint([recording]))
    return Done(outcome, origin, files)


def refuse_unwritable(folder: Path) -> None:
    """Raises RunError where nothing could be kept, before anybody has measured anything."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        trial = folder / f".trial.{os.getpid()}"
        trial.write_text("".join(map(str, range(ROOM))))
        trial.unlink()
    except OSError as error:
        raise _unwritable(folder, error) from error


ROOM = 1000  # numbers: some kB, that a full disk does not take


def _unwritable(folder: Path, error: OSError) -> RunError:
    cause = f"cannot write there: {error.strerror}"
    fix = "go to a folder of yours, on a disk that has room"
    return RunError(Problem("E-CALIBRATE-WRITE", str(folder), cause, fix))


def _free(folder: Path, begins: str, suffix: str) -> Path:
    """A name that is not taken; two steps may end in the same second."""
    number, path = 1, folder / f"{begins}{suffix}"
    while path.exists():
        number += 1
        path = folder / f"{begins}-{number}{suffix}"
    return path


def table(frames: Sequence[Encoders]) -> str:
    """Frames as the CSV text that `calibrate from-log` reads; more columns tell what drove them."""
    lines = ["time,right,left,right_edge,left_edge,right_command,left_command,kind,boot"]
    for frame in frames:
        edges = [
            "" if edge is None else f"{edge * SECONDS:.6f}"
            for edge in (frame.right_edge, frame.left_edge)
        ]
        cells = [f"{frame.time * SECONDS:.6f}", frame.right, frame.left, *edges,
                 f"{frame.right_command:.5f}", f"{frame.left_command:.5f}",
                 frame.command_kind, frame.boot]  # fmt: skip
        lines.append(",".join(map(str, cells)))
    return "\n".join(lines) + "\n"
