"""Heading and end of long drives with a calibrated gyro, beside the same robots without it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from math import cos, degrees, hypot, pi, radians, sin, sqrt
from pathlib import Path
from random import Random
from statistics import NormalDist, fmean, median
from tempfile import TemporaryDirectory
from typing import NamedTuple

from diffbotctl.calibrate.runner import make_step, open_session, run_step
from diffbotctl.config.load import load, load_robot
from diffbotctl.messages import Goal
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.runs.options import RunOptions, RunResult
from diffbotctl.runs.run import Run
from prove.motion import OPEN_FLOOR
from tests.support.calibration_robots import SilentScreen
from tests.support.matrix_case import position_sigmas
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

SCALE_SD = 0.003  # what a calibration leaves of the gyro's scale
# Floor noise of 0.5 deg per root metre, and turns that slip by up to 1 %.
FLOOR = "slip: 0.8 mm, geometry: {{track_spread: 0.01, diameter_spread: {}}}"
# Largest relative error of a diameter. That of a calibration is such that fine encoders alone know
# the heading after a metre to 1 deg, and after 10 m around a square to 9 deg.
CALIBRATED, EXACT = 0.0026, 0.0
ENCODERS = {
    "20 slots": "drive: {polarity: checked_by_hand}",
    "1320 counts": "drive: {polarity: checked_by_hand, encoder: {channels: 2, slots: 1320}, "
    "left: {encoder: {pin_b: 22}}, right: {encoder: {pin_b: 23}}}",
}
LONGEST_S = 300.0
LEGS, ZIGZAG_TURN = 10, radians(60.0)
WRONG_AXES = ("-z", "x", "-x", "y", "-y")  # of an IMU whose z is stated to point up
ASIDE = Goal(0, 1, 0.0, 0.5)  # behind a turn
SCALE_ERROR_MAX = 0.003


class Trial(NamedTuple):
    """One robot of several, whose scales are spread evenly over what calibrations leave."""

    seed: int
    scale_error: float  # relative

    @staticmethod
    def several(seed: int, count: int) -> list[Trial]:
        """`count` robots; the sd of their scale errors is SCALE_SD, not that of a draw."""
        spread = NormalDist(0.0, SCALE_SD)
        errors = [spread.inv_cdf((number + 0.5) / count) for number in range(count)]
        exact = SCALE_SD / sqrt(fmean(error * error for error in errors)) if count > 1 else 1.0
        return [Trial(seed + number, exact * error) for number, error in enumerate(errors)]


class DriveEnd(NamedTuple):
    """Error of the estimated heading (deg), and the true distance from the goal (m)."""

    heading: float
    far: float
    ended: bool


def straight(length: float) -> list[Goal]:
    """Straight ahead."""
    return [Goal(0, 1, length, 0.0, 0.0)]


def square(length: float) -> list[Goal]:
    """Four sides (m)."""
    side = length / 4
    corners = [(side, 0.0), (side, side), (0.0, side), (0.0, 0.0)]
    return [
        Goal(0, number, *corner, number * pi / 2 % (2 * pi))
        for number, corner in enumerate(corners, 1)
    ]


def zigzag(length: float) -> list[Goal]:
    """Ten legs, each at 60 deg to the last one."""
    goals, x, y = [], 0.0, 0.0
    for number in range(1, LEGS + 1):
        heading = 0.5 * ZIGZAG_TURN * (1 if number % 2 else -1)
        x, y = x + length / LEGS * cos(heading), y + length / LEGS * sin(heading)
        goals.append(Goal(0, number, x, y, None))
    return goals


def robot_file(
    folder: Path, encoders: str, trial: Trial, has_gyro: bool, wheels: float = CALIBRATED
) -> Path:
    """A robot with these encoders, whose gyro has been calibrated but for the trial's error."""
    file = folder / f"{trial.seed}_{has_gyro}.yaml"
    text = (
        f"format: 1\nkind: robot\ninclude: book_2wd\nboard: {{telemetry: 35 Hz}}\n"
        f"{ENCODERS[encoders]}\nsimulation: {{{FLOOR.format(wheels)}}}\n"
    )
    if has_gyro:
        text += "imu: {type: mpu6050}\n"
        file.write_text(text)
        nominal = load_robot(str(file)).nominal
        gyro = draw_robot(nominal, nominal, trial.seed).gyro
        assert gyro is not None
        scale = (1.0 + trial.scale_error) / gyro.scale
        text += f"calibration: {{imu.scale: {{value: {scale:.5f}, sd: {SCALE_SD}}}}}\n"
    file.write_text(text)
    return file


def driven(file: Path, goals: list[Goal], seed: int, *sets: str) -> RunResult:
    """A run along all goals on an open floor."""
    options = RunOptions(goals=tuple(goals), seed=seed, fast=True, duration=LONGEST_S)
    return Run(load("goal", str(file), [*OPEN_FLOOR, *sets]), options, tell=lambda _: None).go()


def drive(
    goals: list[Goal], encoders: str, trial: Trial, has_gyro: bool, wheels: float = CALIBRATED
) -> DriveEnd:
    """The end of one drive along all goals."""
    with TemporaryDirectory() as folder:
        file = robot_file(Path(folder), encoders, trial, has_gyro, wheels)
        result = driven(file, goals, trial.seed)
    assert result.truth is not None and result.odometry is not None
    pose, goal = result.truth.pose, goals[-1]
    error = degrees(result.odometry.heading - pose.heading)
    ended = result.ending is not None and result.ending.code in (0, 3)
    return DriveEnd(error, hypot(pose.x - goal.x, pose.y - goal.y), ended)


def heading_sd(ends: list[DriveEnd]) -> float:
    """Standard deviation about zero, in deg."""
    return sqrt(fmean(end.heading * end.heading for end in ends))


def rows(seed: int, robots: int, share: float = 1.0) -> Iterator[Row]:
    """Heading and end of drives, `robots` robots a row, over a share of each course's length."""
    courses = (
        ("straight", straight, 1.0, 0.0, 0.1),
        ("square", square, 10.0, 360.0, 1.5),
        ("zigzag", zigzag, 10.0, 30.0, 0.6),
    )
    trials = Trial.several(seed * 1000, robots)
    for name, course, length, turned, target in courses:
        goals = course(length * share)
        both = [
            [drive(goals, "20 slots", trial, gyro) for trial in trials] for gyro in (True, False)
        ]
        with_gyro, without = map(heading_sd, both)
        left = f"{SCALE_SD:.1%} of {turned:g} deg: {SCALE_SD * turned:.2f}"
        figure = f"{with_gyro:.2f} deg (encoders alone: {without:.1f}; {left})"
        ended = all(end.ended for end in both[0])
        yield Row(
            f"heading sd with a gyro, {length * share:g} m {name}",
            figure,
            f"<= {target} deg",
            ended and with_gyro <= target,
        )
    yield from tours(seed, robots, CALIBRATED, 10.0 * share)
    yield from tours(seed, robots, EXACT, 10.0 * share)


def mounting_rows(seed: int, robots: int, axes: int = len(WRONG_AXES)) -> Iterator[Row]:
    """Wrong mountings: refused, and found."""
    chosen = drawn(WRONG_AXES, axes, seed)
    yield from refused_mountings(seed, chosen * robots)
    yield from calibrated_mountings(seed, chosen)


class SlideEnd(NamedTuple):
    """How a goal ended: error of the odometry in m, and in reported standard deviations."""

    code: int
    error: float
    sigmas: float


def slide(encoders: str, trial: Trial, is_sliding: bool) -> SlideEnd:
    """One goal, on the way to which a wheel slides by a random share for a random time."""
    rng = Random(f"slide {trial.seed}")
    start, share = rng.uniform(2.5, 5.0), rng.uniform(0.2, 1.0)
    fault = (
        f"{{fault: wheel_slide, at: {start} s, for: {rng.uniform(0.3, 3.0)} s, "
        f"side: {rng.choice(('left', 'right'))}, size: {share}}}"
    )
    goal = Goal(0, 1, rng.uniform(0.8, 2.0), rng.uniform(-1.0, 1.0))
    with TemporaryDirectory() as folder:
        file = robot_file(Path(folder), encoders, trial, True, EXACT)
        sets = [f"robot.simulation.faults=[{fault}]"] * is_sliding
        result = driven(file, [goal], trial.seed, *sets)
    assert result.truth is not None and result.odometry is not None
    truth, reported = result.truth.pose, result.odometry
    x, y = truth.x - reported.x, truth.y - reported.y
    code = -1 if result.ending is None else result.ending.code
    return SlideEnd(code, hypot(x, y), position_sigmas(x, y, reported))


def sliding_wheels(seed: int, robots: int) -> Iterator[Row]:
    """A wheel that slides: the goal is not claimed where the robot is not."""
    for encoders in ENCODERS:
        trials = Trial.several(seed * 3000, robots)
        ends = [slide(encoders, trial, True) for trial in trials]
        false = [end for end in ends if not end.code and end.error > 0.02 and end.sigmas > 4.0]
        unsure = sum(end.code == 3 for end in ends)
        worst = max(end.error for end in ends)
        figure = (
            f"{len(false)} of {robots}, {unsure} unsure, {worst * 1000:.0f} mm at most"
            + "".join(f"; {end.error * 1000:.0f} mm" for end in false)
        )
        name = f"a wheel slides, {encoders}: claimed, but over 20 mm and 4 sd off"
        yield Row(name, figure, "0", not false)
        healthy = [slide(encoders, trial, False) for trial in trials]
        doubted = sum(end.code == 3 for end in healthy)
        yield Row(
            f"no wheel slides, {encoders}: unsure", f"{doubted} of {robots}", "0", not doubted
        )


def tours(seed: int, count: int, wheels: float, length: float) -> Iterator[Row]:
    """Row 9; with exact wheels only the track, the floor and the pitch disturb the encoders."""
    for encoders, share in (("20 slots", 0.25), ("1320 counts", 0.5)):
        medians = [
            median(
                drive(square(length), encoders, trial, gyro, wheels).far
                for trial in Trial.several(seed * 2000, count)
            )
            for gyro in (True, False)
        ]
        ratio = medians[0] / medians[1]
        figure = f"{ratio:.2f} ({medians[0] * 1000:.0f} of {medians[1] * 1000:.0f} mm)"
        name = f"{length:g} m tour, {encoders}: true end error with over without the gyro"
        if wheels == EXACT:
            yield Row(f"{name}, exact wheels", figure, "(none)", True)
        else:
            yield Row(name, figure, f"<= {share}", ratio <= share)


def mounted_robot(folder: Path, axes: str, polarity: str = "checked_by_hand") -> Path:
    """A robot whose file has axes: z, and whose IMU is mounted otherwise."""
    file = folder / f"mounted_{axes}.yaml"
    file.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\nboard: {telemetry: 35 Hz}\n"
        f"imu: {{type: mpu6050}}\ndrive: {{polarity: {polarity}}}\n"
        f"simulation: {{gyro: {{axes: {axes}}}}}\n"
        f"calibration: {{imu.scale: {{value: 1.0, sd: {SCALE_SD}}}}}\n"
    )
    return file


def refused_mountings(seed: int, mountings: list[str]) -> Iterator[Row]:
    """Runs with an IMU that is mounted otherwise than the file states: gravity shows it."""
    refused, travel = 0, 0.0
    for number, axes in enumerate(mountings):
        with TemporaryDirectory() as folder:
            file = mounted_robot(Path(folder), axes)
            result = driven(file, [ASIDE], seed + number)
        assert result.truth is not None
        codes = [] if result.failure is None else [each.code for each in result.failure.problems]
        refused += codes == ["E-IMU-FAULT"]
        travel = max(travel, result.truth.travel)
    runs = len(mountings)
    figure = f"{refused} of {runs}, {travel * 1000:g} mm driven"
    is_met = refused == runs and travel == 0.0
    yield Row("wrong axes: refused before anything moves", figure, "all, 0 mm", is_met)


def calibrated_mountings(seed: int, mountings: list[str]) -> Iterator[Row]:
    """`calibrate imu` on each wrong mounting, with and without proven motors."""
    found, worst = 0, 0.0
    cases = list(product(mountings, ("checked_by_hand", "unproven")))
    for number, (axes, polarity) in enumerate(cases):
        with TemporaryDirectory() as name:
            answers = Path(name) / "answers.yaml"
            answers.write_text("imu: {measure: protractor, noise: 1 deg}\n")
            file = load_robot(str(mounted_robot(Path(name), axes, polarity)))
            session, tools = open_session(file, "sim", seed + number)
            with session:
                asked = AnswersFile(answers, tools)
                outcome = run_step(make_step("imu"), session, asked, SilentScreen())
        assert tools is not None
        found += outcome.findings[0].value == axes
        worst = max(
            worst, *(abs(each.found / each.true - 1.0) for each in tools.compare(outcome.findings))
        )
    figure = f"{found} of {len(cases)}, scale error at most {100 * worst:.2f} %"
    is_met = found == len(cases) and worst <= SCALE_ERROR_MAX
    yield Row("wrong axes: found by calibrate imu", figure, "all, <= 0.3 %", is_met)
