"""One step of the calibration: it asks questions, moves the robot, and returns findings.

A step is a generator. It yields what to show, ask or do, and receives the answers; so the same step
serves a person at a terminal, an answers file and a test. The runner (runner.py) shows the events,
asks the questions and writes the findings.

    def run(self, session):
        yield MotionNotice("turns each wheel for half a second", turns=2.0)
        frames = session.run_for(Duty(0, 0.5, 0.0), 0.5)
        reading = yield Question("distance.reading", "Distance on the tape?", "m", "mm")
        return Outcome("distance", [Finding(...)], ["a line for the report"])
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, TypeVar

from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import KeyStopError, RobotSession
from diffbotctl.config.robot import Robot
from diffbotctl.prompts.question import (
    ExpectedQuestion,
    ManualAction,
    MarkFloor,
    MotionNotice,
    Question,
)

Moved = TypeVar("Moved")


class Message(NamedTuple):
    """A line of text for the person."""

    text: str


class StepProgress(NamedTuple):
    """Progress of the step: `done` of `total`."""

    what: str
    done: float
    total: float


class ScatterPlot(NamedTuple):
    """Points for the terminal by group, in m, x to the right and y up."""

    title: str
    points: dict[str, list[tuple[float, float]]]


class CurvePlot(NamedTuple):
    """A curve and its points for the terminal, x to the right and y up."""

    title: str
    points: dict[str, list[tuple[float, float]]]  # by group
    x_unit: str
    y_unit: str


Event = (
    Message
    | MotionNotice
    | MarkFloor
    | ManualAction
    | StepProgress
    | ScatterPlot
    | CurvePlot
    | Question
)
StepRun = Generator[Event, Any, "Outcome"]


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a step."""

    method: str
    findings: Sequence[Finding]
    report: Sequence[str] = ()  # lines of text, in order
    faults: Sequence[str] = ()  # faults of the robot that settings cannot correct
    pictures: dict[str, str] = field(default_factory=dict)
    """contents of files by the end of the file name, such as an SVG"""
    volts: float | None = None  # of the battery, if it was measured
    is_recorded: bool = True  # false where the robot has nothing to measure


class Step(Protocol):
    """One step. `name` is the name of its command."""

    name: str
    title: str  # what it measures, in a few words
    lifted: bool  # whether the wheels must be off the ground

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """What it will ask on this robot; also what it may ask, or would ask on another one."""

    def run(self, session: RobotSession) -> StepRun:
        """Run the step. Raises RunError if it fails or is stopped."""


def counted(number: int, count: int, text: str) -> str:
    """`text` with `2 of 5: ` in front; `number` counts from 0. Alone if it is the only one."""
    return f"{number + 1} of {count}: {text}" if count > 1 else text


def marked_motion(
    session: RobotSession, mark: MarkFloor, move: Callable[[], Moved]
) -> Generator[Event, Any, Moved]:
    """Have the floor marked, then move. A key that stops the robot costs this motion only: it is
    offered again, and Enter alone does not start it then."""
    while True:
        yield mark
        try:
            return move()
        except KeyStopError:
            session.stop_and_wait()
            yield Message("A key stopped the robot. What was measured before is kept.")
            mark = mark._replace(is_repeated=True)
