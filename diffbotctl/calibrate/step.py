"""One step of the calibration: it asks, moves the robot, and comes to findings.

A step is a generator. It yields what is to be drawn, asked or done, and is sent the answer of what
it asked; so the same step serves a person at a terminal, an answers file and a test. Whoever runs
it (runner.py) draws the events, asks the questions and writes down the findings.

    def run(self, session):
        yield MotionNotice("turns each wheel for half a second", turns=2.0)
        frames = session.run_for(Duty(0, 0.5, 0.0), 0.5)
        reading = yield Question("distance.reading", "What does the tape say?", "m", "mm")
        return Outcome("distance", [Finding(...)], ["what a person should know of it"])
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from diffbotctl.calibrate.result import Finding
from diffbotctl.prompts.question import ManualAction, MarkFloor, MotionNotice, Question

if TYPE_CHECKING:
    from diffbotctl.calibrate.session import RobotSession


class Message(NamedTuple):
    """A line for the person who waits."""

    text: str


class StepProgress(NamedTuple):
    """How far the step is."""

    what: str
    done: float
    total: float


class ScatterPlot(NamedTuple):
    """Points for the terminal by their kind, m, x to the right and y upwards."""

    title: str
    points: dict[str, list[tuple[float, float]]]


class CurvePlot(NamedTuple):
    """A curve and points of it for the terminal, x to the right and y upwards."""

    title: str
    points: dict[str, list[tuple[float, float]]]
    """by their kind, drawn one over the other"""
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
    """What a step came to."""

    method: str
    findings: Sequence[Finding]
    report: Sequence[str] = ()
    """lines for a person, in order"""
    faults: Sequence[str] = ()
    """what is wrong with the robot, in words of wires and screws; not what was found and mended"""
    pictures: dict[str, str] = field(default_factory=dict)
    """SVG texts by the end of their file's name"""
    volts: float | None = None
    """of the battery, when it was measured"""


class Step(Protocol):
    """One step of the chain, by the name that its command has."""

    name: str
    title: str
    """what it finds, in a few words"""
    lifted: bool
    """whether the wheels must be off the ground"""

    def run(self, session: RobotSession) -> StepRun:
        """Do it. Raises RunError when it cannot be done, or was stopped."""
