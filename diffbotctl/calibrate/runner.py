"""Runs the steps of a calibration and keeps what they recorded.

The order of STEPS is the order of the whole calibration: each step finds what would spoil the
results of the next.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, assert_never

from diffbotctl.calibrate.log_reader import SIMULATED_COLUMN, fingerprint
from diffbotctl.calibrate.result import Provenance, format_date
from diffbotctl.calibrate.session import RobotSession, StopKey
from diffbotctl.calibrate.step import (
    CurvePlot,
    Event,
    Message,
    Outcome,
    ScatterPlot,
    Step,
    StepProgress,
)
from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.motor_pulses import calibrated_pulses
from diffbotctl.drivers.robot_ports import has_encoders, is_simulated_port
from diffbotctl.drivers.serial_robot import open_serial_robot
from diffbotctl.engine.clock import PacedClock
from diffbotctl.engine.driver import RobotDriver
from diffbotctl.errors import ConfigurationError, Problem, RunError
from diffbotctl.messages import Encoders
from diffbotctl.prompts.question import ManualAction, MarkFloor, MotionNotice, Prompter, Question

if TYPE_CHECKING:
    from diffbotctl.calibrate.simulated_session import SimulatedTools
    from diffbotctl.config.robot import Robot
    from diffbotctl.plant.world import World

STEPS_PACKAGE = "diffbotctl.calibrate.steps"
STEPS = {  # name of the step's command -> module and class, imported when used
    "encoders": "encoders:EncoderStep",
    "motors": "motors:MotorStep",
    "distance": "distance:DistanceStep",
    "geometry": "squares:SquaresStep",
    "imu": "imu:ImuStep",
    "range": "range:RangeStep",
    "battery": "battery:BatteryStep",
}
STEP_RESULTS = {  # name of the step's command -> a field that it always finds
    "encoders": "drive.polarity",
    "motors": "drive.left.motor.lag",
    "distance": "drive.left.wheel.diameter",
    "geometry": "drive.track",
    "imu": "imu.scale",
    "range": "sensors.*.curve.a",
    "battery": "battery.divider",
}
GEOMETRY_METHODS = {  # the first one finds track and wheel ratio, the others one of them
    "squares": "squares:SquaresStep",
    "spin": "spin:SpinStep",
    "straight": "straight:StraightStep",
}
NS = 1e-9  # s
PROBE_TEXT = "".join(map(str, range(1000)))  # some kB, which do not fit on a full disk


def make_step(name: str, **settings: object) -> Step:
    """The step called `name` with its own settings, such as the number of repeats.

    The setting `how` of `geometry` selects one of GEOMETRY_METHODS.
    """
    method = settings.pop("how", None)
    module, _, kind = (STEPS[name] if method is None else GEOMETRY_METHODS[str(method)]).partition(
        ":"
    )
    step: Step = getattr(import_module(f"{STEPS_PACKAGE}.{module}"), kind)(**settings)
    return step


def is_done(name: str, robot: Robot) -> bool:
    """Whether the robot file has the results of the step called `name`."""
    return any(fnmatchcase(field, STEP_RESULTS[name]) for field in robot.calibration)


def question_names(robot: Robot) -> list[str]:
    steps = [
        *(make_step(name) for name in STEPS),
        *(make_step("geometry", how=how) for how in GEOMETRY_METHODS),
    ]
    questions = (item.what for step in steps for item in step.questions(robot))
    return sorted({what.name for what in questions if isinstance(what, Question)})


class Screen(Protocol):
    """Shows what happens."""

    def say(self, text: str) -> None: ...
    def progress(self, progress: StepProgress) -> None: ...
    def draw(self, plot: ScatterPlot | CurvePlot) -> None: ...


@dataclass(frozen=True, slots=True)
class StepDone:
    """A finished step: the provenance of its findings, and the files that it left."""

    origin: Provenance
    files: Sequence[Path]  # recording and pictures


def open_session(
    file: RobotFile,
    port: str,
    seed: int = 0,
    key: StopKey | None = None,
    report: Callable[[str], None] = print,
    world: World | None = None,
) -> tuple[RobotSession, SimulatedTools | None]:
    """The robot of `file` behind `port` (`sim`, `emulated` or a device), and tools to measure it.

    Simulated and emulated robots run in virtual time, as fast as possible; a real one has no tools.
    Raises RunError if the port cannot be opened, EmulatorError if there is no emulator,
    ConfigurationError for a robot without encoders.
    """
    if not has_encoders(file.robot):
        cause = "every step measures with the encoders, and this robot has none"
        fix = "add encoders; until then drive by hand: `diffbotctl run teleop`"
        raise ConfigurationError(Problem("E-ENCODER-NONE", str(file.file), cause, fix))
    if port in ("sim", "emulated"):
        # A real robot needs neither plant nor emulator.
        from diffbotctl.calibrate.simulated_session import open_simulated

        return open_simulated(file, port, seed, key, world)

    def make_driver(file: RobotFile, previous: RobotDriver | None, now: int) -> RobotDriver:
        if previous is not None:
            previous.close()
        return open_serial_robot(file.robot, port, report, now, is_upward_checked=False)

    clock = PacedClock(exact=False)
    return RobotSession(file, make_driver, clock, key, is_simulated_port(port)), None


def run_step(step: Step, session: RobotSession, prompter: Prompter, screen: Screen) -> Outcome:
    """Run one step to its end. The robot is stopped afterwards, however the step ended.

    The session continues with the findings. Raises RunError if the step failed or was stopped,
    ConfigurationError if a finding is not plausible.
    """
    events = step.run(session)
    answer: Any = None
    try:
        while True:
            answer = _handle(events.send(answer), session, prompter, screen)
    except StopIteration as end:
        outcome: Outcome = end.value
        if outcome.findings:
            session.try_findings(outcome.findings)
        return outcome
    finally:
        events.close()
        session.limit_turns(None)
        session.driver.stop(session.now)


def _handle(event: Event, session: RobotSession, prompter: Prompter, screen: Screen) -> Any:
    """Do what the event asks for. Returns the answer to a question, else None."""
    match event:
        case Question():
            return prompter.answer(event)
        case MotionNotice():
            screen.say(event.text)
            prompter.confirm_motion(event)
            session.limit_turns(event.turns if event.watched else None)
        case MarkFloor():
            screen.say(event.text)
            prompter.mark_floor(event)
        case ManualAction():
            screen.say(event.text)
            session.limit_turns(None)  # turning a wheel by hand is not limited
            prompter.act(event)
        case Message():
            screen.say(event.text)
        case StepProgress():
            screen.progress(event)
        case ScatterPlot() | CurvePlot():
            screen.draw(event)
        case _:
            assert_never(event)
    return None


def save_result(step: Step, outcome: Outcome, session: RobotSession, folder: Path) -> StepDone:
    """Write the step's recording and pictures into `folder`. Raises RunError if it cannot."""
    now = datetime.now(UTC)
    frames, session.recording = session.recording, []
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        recording = _free_path(folder, f"{step.name}-{now:%Y%m%d-%H%M%S}", ".csv")
        recording.write_text(encoder_table(frames, session.is_simulated))
        files.append(recording)
        for name, text in outcome.pictures.items():
            picture = recording.with_name(f"{recording.stem}-{name}")
            picture.write_text(text)
            files.append(picture)
    except OSError as error:
        raise _unwritable(folder, error) from error
    taken_from, simulated = fingerprint([recording]), session.is_simulated
    pulses = calibrated_pulses(session.file.robot)
    origin = Provenance(
        outcome.method, format_date(now), outcome.volts, taken_from, simulated, pulses
    )
    return StepDone(origin, files)


def refuse_unwritable(folder: Path) -> None:
    """Raises RunError if nothing can be written into `folder`, before anybody measures anything."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".trial.{os.getpid()}"
        probe.write_text(PROBE_TEXT)
        probe.unlink()
    except OSError as error:
        raise _unwritable(folder, error) from error


def _unwritable(folder: Path, error: OSError) -> RunError:
    cause = f"cannot be written: {error.strerror}"
    fix = "change to a folder of your own, on a disk with free space"
    return RunError(Problem("E-CALIBRATE-WRITE", str(folder), cause, fix))


def _free_path(folder: Path, stem: str, suffix: str) -> Path:
    """A path that does not exist; two steps may end in the same second."""
    number, path = 1, folder / f"{stem}{suffix}"
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}{suffix}"
    return path


def encoder_table(frames: Sequence[Encoders], is_simulated: bool) -> str:
    """Frames as the CSV text that `calibrate from-log` reads, with edge times and commands.

    Those of a simulated robot have one more column, whose name marks them.
    """
    lines = ["time,right,left,right_edge,left_edge,right_command,left_command,kind,boot"]
    lines[0] += f",{SIMULATED_COLUMN}" if is_simulated else ""
    for frame in frames:
        edges = [
            "" if edge is None else f"{edge * NS:.6f}"
            for edge in (frame.right_edge, frame.left_edge)
        ]
        lines.append(
            f"{frame.time * NS:.6f},{frame.right},{frame.left},{edges[0]},{edges[1]},"
            f"{frame.right_command:.5f},{frame.left_command:.5f},{frame.command_kind},{frame.boot}"
        )
    return "\n".join(lines) + "\n"
