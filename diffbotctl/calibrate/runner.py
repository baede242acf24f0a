"""The steps in the order in which each finds what would spoil the next.

Runs steps: draws their events, has their questions answered, and keeps what they recorded.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from diffbotctl.calibrate.answers_file import Prompter
from diffbotctl.calibrate.log_reader import fingerprint
from diffbotctl.calibrate.result import Provenance, format_date
from diffbotctl.calibrate.session import RobotSession, StopKey
from diffbotctl.calibrate.step import (
    CurvePlot,
    Event,
    ManualAction,
    MarkFloor,
    Message,
    MotionNotice,
    Outcome,
    ScatterPlot,
    Step,
    StepProgress,
)
from diffbotctl.config.configuration import RobotFile
from diffbotctl.drivers.serial_robot import open_serial_robot
from diffbotctl.engine.clock import PacedClock
from diffbotctl.engine.driver import RobotDriver
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Encoders
from diffbotctl.prompts.question import Answer, AnswerError, Question

if TYPE_CHECKING:
    from diffbotctl.calibrate.simulated_session import SimulatedTools
    from diffbotctl.plant.world import World

# Name of the step's command -> where its class is; imported when used.
STEPS = {
    "encoders": "diffbotctl.calibrate.steps.encoders:EncoderStep",
    "motors": "diffbotctl.calibrate.steps.motors:MotorStep",
    "discs": "diffbotctl.calibrate.steps.discs:DiscStep",
    "distance": "diffbotctl.calibrate.steps.distance:DistanceStep",
    "geometry": "diffbotctl.calibrate.steps.squares:SquaresStep",
    "range": "diffbotctl.calibrate.steps.range:RangeStep",
    "battery": "diffbotctl.calibrate.steps.battery:BatteryStep",
}

GEOMETRY_METHODS = {
    "squares": "diffbotctl.calibrate.steps.squares:SquaresStep",
    "spin": "diffbotctl.calibrate.steps.spin:SpinStep",
    "straight": "diffbotctl.calibrate.steps.straight:StraightStep",
}
"""the ways to find a geometry; the first finds all of it"""


def make_step(name: str, **settings: object) -> Step:
    """The step called `name`, with settings of its own such as how often it repeats.

    The setting `how` of geometry says which of its ways.
    """
    way = settings.pop("how", None)
    module, _, kind = (STEPS[name] if way is None else GEOMETRY_METHODS[str(way)]).partition(":")
    made: Step = getattr(import_module(module), kind)(**settings)
    return made


ANSWER_ATTEMPTS_MAX = 5  # answers of no use, until a question is given up
NS = 1e-9


class Screen(Protocol):
    """Draws what happens."""

    def say(self, text: str) -> None: ...
    def progress(self, progress: StepProgress) -> None: ...
    def draw(self, drawing: ScatterPlot | CurvePlot) -> None: ...


@dataclass(frozen=True, slots=True)
class StepDone:
    """A step that was finished, and where its findings come from."""

    outcome: Outcome
    origin: Provenance
    files: Sequence[Path]
    """recording and pictures"""


def open_session(
    file: RobotFile,
    port: str,
    seed: int = 0,
    key: StopKey | None = None,
    report: Callable[[str], None] = print,
    world: World | None = None,
) -> tuple[RobotSession, SimulatedTools | None]:
    """The robot of `file` behind `port` (`sim`, `emulated` or a device), and tools to measure it.

    Simulated and emulated robots live in virtual time, as fast as it goes. Raises RunError when the
    port cannot be opened, EmulatorError when there is no emulator.
    """
    if port == "sim" or port == "emulated":
        # A real robot needs neither plant nor emulator.
        from diffbotctl.calibrate.simulated_session import open_simulated

        return open_simulated(file, port, seed, key, world)

    def make_driver(file: RobotFile, previous: RobotDriver | None, now: int) -> RobotDriver:
        if previous is not None:
            previous.close()
        return open_serial_robot(file.robot, port, report, now)

    return RobotSession(file, make_driver, PacedClock(exact=False), key), None


def run_step(step: Step, rig: RobotSession, attendant: Prompter, screen: Screen) -> Outcome:
    """Run one step to its end; the robot stands still afterwards, however it ended.

    The rig goes on with what was found. Raises RunError when the step failed or was stopped,
    ConfigurationError when what it found is not plausible.
    """
    running = step.run(rig)
    sent: Any = None
    try:
        while True:
            event = running.send(sent)
            sent = _handle(event, rig, attendant, screen)
    except StopIteration as end:
        outcome: Outcome = end.value
        if outcome.findings:
            rig.attempt(outcome.findings)
        return outcome
    finally:
        running.close()
        rig.allow(None)
        rig.driver.stop(rig.now)


def _handle(event: Event, rig: RobotSession, attendant: Prompter, screen: Screen) -> Any:
    if isinstance(event, Question):
        return ask(event, attendant)
    if isinstance(event, MotionNotice):
        screen.say(event.text)
        attendant.agree(event)
        rig.allow(event.turns if event.watched else None)
    elif isinstance(event, MarkFloor):
        screen.say(event.text)
        attendant.mark(event)
    elif isinstance(event, ManualAction):
        screen.say(event.text)
        rig.allow(None)  # what a hand turns was not announced
        attendant.act(event)
    elif isinstance(event, Message):
        screen.say(event.text)
    elif isinstance(event, StepProgress):
        screen.progress(event)
    else:
        screen.draw(event)
    return None


def ask(question: Question, attendant: Prompter) -> Answer:
    """The answer to a question that is asked again, with the reason, until it is one.

    Raises RunError when that does not come about.
    """
    trouble = ""
    for _ in range(ANSWER_ATTEMPTS_MAX):
        try:
            return attendant.answer(question, trouble)
        except AnswerError as error:
            trouble = str(error)
    fix = "measure first, then run this step again"
    raise RunError(Problem("E-CALIBRATE-ANSWER", question.name, trouble, fix))


def save_result(step: Step, outcome: Outcome, rig: RobotSession, folder: Path) -> StepDone:
    """Write the step's recording and pictures into `folder`. Raises RunError when it cannot."""
    now = datetime.now(UTC)
    begins = f"{step.name}-{now:%Y%m%d-%H%M%S}"
    rows, rig.recording = rig.recording, []
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        recording = _free_path(folder, begins, ".csv")
        recording.write_text(encoder_table(rows))
        files.append(recording)
        for name, text in outcome.pictures.items():
            picture = recording.with_name(f"{recording.stem}-{name}")
            picture.write_text(text)
            files.append(picture)
    except OSError as error:
        raise _unwritable(folder, error) from error
    origin = Provenance(outcome.method, format_date(now), outcome.volts, fingerprint([recording]))
    return StepDone(outcome, origin, files)


def refuse_unwritable(folder: Path) -> None:
    """Raises RunError where nothing could be kept, before anybody has measured anything."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        trial = folder / f".trial.{os.getpid()}"
        trial.write_text("".join(map(str, range(PROBE_NUMBERS))))
        trial.unlink()
    except OSError as error:
        raise _unwritable(folder, error) from error


PROBE_NUMBERS = 1000  # numbers: some kB, that a full disk does not take


def _unwritable(folder: Path, error: OSError) -> RunError:
    cause = f"cannot write there: {error.strerror}"
    fix = "go to a folder of yours, on a disk that has room"
    return RunError(Problem("E-CALIBRATE-WRITE", str(folder), cause, fix))


def _free_path(folder: Path, begins: str, suffix: str) -> Path:
    """A name that is not taken; two steps may end in the same second."""
    number, path = 1, folder / f"{begins}{suffix}"
    while path.exists():
        number += 1
        path = folder / f"{begins}-{number}{suffix}"
    return path


def encoder_table(frames: Sequence[Encoders]) -> str:
    """Frames as the CSV text that `calibrate from-log` reads; more columns tell what drove them."""
    lines = ["time,right,left,right_edge,left_edge,right_command,left_command,kind,boot"]
    for frame in frames:
        edges = [
            "" if edge is None else f"{edge * NS:.6f}"
            for edge in (frame.right_edge, frame.left_edge)
        ]
        cells = [
            f"{frame.time * NS:.6f}",
            frame.right,
            frame.left,
            *edges,
            f"{frame.right_command:.5f}",
            f"{frame.left_command:.5f}",
            frame.command_kind,
            frame.boot,
        ]
        lines.append(",".join(map(str, cells)))
    return "\n".join(lines) + "\n"
