"""`diffbotctl calibrate encoders`, `motors`, ...: single steps, and all of them in order.

`diffbotctl calibrate range`, `battery`: single parts of the robot.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from diffbotctl.cli.calibrate_results import keep, own, require_consent
from diffbotctl.cli.choose_port import choose_port
from diffbotctl.cli.command import option, subcommand
from diffbotctl.cli.options import (
    ANSWERS,
    ROBOT,
    SEED,
    YES,
    choice_option,
    number_option,
    port_option,
)
from diffbotctl.config.lookup import display_path
from diffbotctl.errors import Problem, RunError
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.calibrate.session import RobotSession
    from diffbotctl.calibrate.simulated_session import SimulatedTools
    from diffbotctl.calibrate.step import Step
    from diffbotctl.config.robot import Robot
    from diffbotctl.prompts.keyboard import Keyboard
    from diffbotctl.prompts.question import Prompter
    from diffbotctl.ui.calibration_screen import CalibrationScreen

LineInput = Callable[[], AbstractContextManager[None]]
"""In its context the terminal echoes and edits a line"""
INTERRUPTED = "\nInterrupted: the robot is stopped, and no result of this step was written."
FOLDER = Path("recordings")


class CalibrateOptions(NamedTuple):
    """The options that all steps share."""

    robot: str | None = ROBOT
    port: str = port_option("auto")
    seed: int = SEED
    answers: Path | None = ANSWERS
    yes: bool = YES
    dry_run: bool = option("Do not write the robot file.")
    fast: bool = option("Simulated robot: press Enter, and take the readings, by itself.")


def run(names: Sequence[str], options: CalibrateOptions, **settings: object) -> None:
    """Run the steps called `names` in order on one robot; `settings` go to each."""
    from diffbotctl.calibrate.runner import make_step, refuse_unwritable
    from diffbotctl.ui.calibration_screen import CalibrationScreen, truth_report

    if not options.yes and not options.dry_run:
        require_consent("--dry-run")
    refuse_unwritable(FOLDER)
    screen = CalibrationScreen()
    steps = [make_step(name, **settings) for name in names]
    with _open_robot(options) as (session, prompter, tools, lines):
        _check_answers(prompter, steps, session.file.robot)
        with lines():
            first = _first_step(steps, session.file.robot, options)
        for number, step in list(enumerate(steps, 1))[first:]:
            if len(steps) > 1:
                with lines():
                    is_confirmed = _confirm_step(step, number, len(steps), options)
                if not is_confirmed:
                    continue
            _run_step(step, session, prompter, screen, options, lines)
        if tools is not None:
            for line in truth_report(tools.compare(session.findings.values())):
                click.echo(line)


def _check_answers(prompter: Prompter, steps: Sequence[Step], robot: Robot) -> None:
    """Raises RunError for an answers file that does not fit the questions of these steps."""
    from diffbotctl.calibrate.runner import question_names
    from diffbotctl.cli.start_steps import QUESTIONS
    from diffbotctl.prompts.answers_file import AnswersFile

    if isinstance(prompter, AnswersFile):
        expected = [item for step in steps for item in step.questions(robot)]
        # `diffbotctl start` has its own questions in the same file.
        names = [*question_names(robot), *(question.name for question in QUESTIONS)]
        prompter.check(expected, names)


def _run_step(
    step: Step,
    session: RobotSession,
    prompter: Prompter,
    screen: CalibrationScreen,
    options: CalibrateOptions,
    lines: LineInput,
) -> None:
    from diffbotctl.calibrate.runner import run_step, save_result

    try:
        outcome = run_step(step, session, prompter, screen)
    finally:
        screen.rest()
    for line in outcome.report:
        click.echo(fold_text(line, hang=2))
    if not outcome.is_recorded:
        session.recording = []
        return
    done = save_result(step, outcome, session, FOLDER)
    for file in done.files:
        click.echo(f"saved: {file}")
    if outcome.findings and not options.dry_run:
        with lines():
            keep(session.file.file, outcome.findings, done.origin, options.yes)
    if outcome.faults:
        # The next steps would measure these faults.
        fix = f"correct this, then run `diffbotctl calibrate {step.name}` again"
        raise RunError(
            Problem("E-CALIBRATE-ROBOT", step.name, fault, fix) for fault in outcome.faults
        )


def _first_step(steps: Sequence[Step], robot: Robot, options: CalibrateOptions) -> int:
    """Index of the first step to do: that behind those whose results are in the robot file, if the
    person agrees."""
    from diffbotctl.calibrate.runner import is_done

    if len(steps) == 1 or options.yes or options.answers is not None:
        return 0
    are_open = [not is_done(step.name, robot) for step in steps]
    first = are_open.index(True) if any(are_open) else len(steps)
    if not first:
        return 0
    done = ", ".join(step.name for step in steps[:first])
    click.echo(fold_text(f"Calibrated already: {done}."))
    if first == len(steps):
        return 0 if click.confirm("Begin again with step 1?", default=False) else first
    following = f"Go on with step {first + 1}, {steps[first].name}? (n: begin with step 1)"
    return first if click.confirm(following, default=True) else 0


def _confirm_step(step: Step, number: int, count: int, options: CalibrateOptions) -> bool:
    where = "wheels off the ground" if step.lifted else "on the floor"
    click.echo(fold_text(f"\nStep {number} of {count}: {step.name}, {step.title} ({where})"))
    if options.yes or options.fast or options.answers is not None:
        return True
    return click.confirm("Do this step?", default=True)


@contextmanager
def _open_robot(
    options: CalibrateOptions,
) -> Iterator[tuple[RobotSession, Prompter, SimulatedTools | None, LineInput]]:
    """The robot, the prompter, the tools of a simulated robot, and the terminal's line input.

    At the end the robot is stopped and its port closed.
    """
    from diffbotctl.calibrate.runner import open_session
    from diffbotctl.drivers.robot_ports import VIRTUAL_PORTS, is_simulated_port, load_robot_at
    from diffbotctl.prompts.keyboard import Keyboard
    from diffbotctl.runs.signals import signals_as_interrupts

    port = choose_port(radio=True, simulates=True) if options.port == "auto" else options.port
    is_real, is_simulated = port not in VIRTUAL_PORTS, is_simulated_port(port)
    file = load_robot_at(port, options.robot)
    if not options.dry_run:
        file = load_robot_at(port, str(own(file.file, is_simulated).absolute()))
    click.echo(f"robot {display_path(file.file)}, {port}{': SIMULATED' * is_simulated}")
    keyboard = Keyboard(sys.stdin.fileno()) if sys.stdin.isatty() else None
    session, tools = open_session(file, port, options.seed, keyboard, click.echo)
    was_interrupted = False
    try:
        with signals_as_interrupts(), session:
            prompter = _prompter(options, tools, keyboard)
            with nullcontext() if keyboard is None else keyboard.watching():
                lines = nullcontext if keyboard is None else keyboard.resting
                yield session, prompter, tools, lines
    except (click.Abort, KeyboardInterrupt):
        was_interrupted = True
        raise
    finally:
        if not session.stop_confirmed and is_real:
            click.echo("The stop was NOT CONFIRMED: switch the motor battery off.", err=True)
        elif was_interrupted:
            click.echo(INTERRUPTED, err=True)


def _prompter(
    options: CalibrateOptions, tools: SimulatedTools | None, keyboard: Keyboard | None
) -> Prompter:
    from diffbotctl.prompts.answers_file import AnswersFile
    from diffbotctl.ui.terminal_prompter import TerminalPrompter

    if options.answers is not None:
        return AnswersFile(options.answers, tools)
    if keyboard is None:
        raise click.UsageError("There is no terminal: give --answers FILE.")
    if options.fast and tools is None:
        raise click.UsageError("--fast is for --port sim and emulated: a robot waits for each yes.")
    return TerminalPrompter(keyboard, tools, options.fast)


@subcommand("encoders")
def encoders(
    options: CalibrateOptions,
    turns: int = number_option(10, 1, 100, "Turns by hand in one go."),
    rolls: int = number_option(3, 0, 20, "How often each wheel is turned by hand; 0: not at all."),
) -> None:
    """Find out which wire is which, which way is forward, how many slots.

    Wheels off the ground. Pulses one motor at a time and asks which wheel turned; then the wheels
    are turned by hand. What settings can make up for goes into the robot file.
    """
    run(["encoders"], options, turns=turns, rolls=rolls)


@subcommand("motors")
def motors(options: CalibrateOptions) -> None:
    """Find out how the motors follow: dead band, speed, lag. Sets the speed loops.

    Wheels off the ground.
    """
    run(["motors"], options)


@subcommand("distance")
def distance(
    options: CalibrateOptions,
    metres: float = number_option(1.0, 0.2, 20, "How far it drives."),
    repeats: int = number_option(5, 1, 50, "How often."),
) -> None:
    """Drive a metre several times, by the tape: finds the size of the wheels."""
    run(["distance"], options, metres=metres, repeats=repeats)


@subcommand("geometry")
def geometry(
    options: CalibrateOptions,
    how: str = choice_option(
        ("squares", "spin", "straight"),
        "Squares find track and wheel ratio; a spin the track alone; straight runs the ratio "
        "alone.",
    ),
    side: float | None = option(
        "Of the squares, in m, or length of the straight; what suits the track when left out.",
        type=click.FloatRange(0.3, 10),
    ),
    runs: int | None = option("How often each way round.", type=click.IntRange(1, 50)),
    rounds: int | None = option(
        "Rounds of squares; each corrects what the one before has left.", type=click.IntRange(1, 5)
    ),
    read: str | None = option(
        "What is measured of each square's end.", type=click.Choice(["places", "headings", "both"])
    ),
) -> None:
    """Find the track and the ratio of the wheels by driving what is then measured (UMBmark)."""
    names = {
        "squares": ("side", "runs"),
        "spin": ("", "repeats"),
        "straight": ("metres", "repeats"),
    }
    settings: dict[str, object] = {"how": how}
    for name, value in zip(names[how], (side, runs), strict=True):
        if value is not None and name:
            settings[name] = value
    if how == "squares":
        given = {"rounds": rounds, "read": read}
        settings |= {name: value for name, value in given.items() if value is not None}
    elif rounds or read or (side and how == "spin"):
        raise click.UsageError(f"--how {how} has no such option: see --help.")
    run(["geometry"], options, **settings)


@subcommand("imu")
def imu(
    options: CalibrateOptions,
    turns: int = number_option(10, 3, 50, "Turns on the spot in one go."),
    repeats: int = number_option(1, 1, 20, "How often in each direction."),
    lift: bool = option(
        "--lift/--no-lift",
        "Whether you lift the robot by hand, which shows that an axis points up or down.",
        default=True,
    ),
) -> None:
    """Find axis and scale of the gyro by turns on the spot.

    On the floor. It turns one to three times for the vertical axis; you lift its front and its left
    side by a hand's width; then it turns ten times to the left and ten times to the right, and asks
    for the heading at the end of each.
    """
    run(["imu"], options, turns=turns, repeats=repeats, lift=lift)


@subcommand("range")
def range_(
    options: CalibrateOptions,
    sensor: str = option("Which distance sensor; the only one when left out.", default=""),
    seconds: float = number_option(
        5.0, 1, 60, "How long the voltage is averaged at each distance."
    ),
) -> None:
    """Find the curve of a distance sensor, with a ruler and a white card.

    Six distances from 4 to 30 cm. Nothing moves.
    """
    run(["range"], options, sensor=sensor, seconds=seconds)


@subcommand("battery")
def battery(options: CalibrateOptions) -> None:
    """Find the ratio of the battery's divider with a meter, and the limit below which it is low.

    Nothing moves.
    """
    run(["battery"], options)


COMMANDS = (encoders, motors, distance, geometry, imu, range_, battery)
