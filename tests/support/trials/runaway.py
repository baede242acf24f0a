"""Wheels that are faster than commanded: which are stopped, how soon, and no healthy robot is, nor
as one whose wheels turn the wrong way.

A motor driver that conducts all the time is simulated by a board that takes the full speed for one
wheel whatever the host commands, until the host sends a stop. Healthy robots are the random ones of
the matrix, and the shipped robots with random motors, on both plants.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import partial
from math import inf
from multiprocessing import Pool
from pathlib import Path
from random import Random
from typing import NamedTuple

from diffbotctl.block import Block, Every, Out
from diffbotctl.config import registry
from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load
from diffbotctl.config.robot import SIDES
from diffbotctl.drivers.simulated_robot import SimulatedRobotDriver
from diffbotctl.engine.overspeed import OverspeedDetector
from diffbotctl.engine.safety_gate import Gate
from diffbotctl.errors import UserError
from diffbotctl.messages import Duty, Goal, Twist, Wheels
from diffbotctl.params import Param
from diffbotctl.plant.simulated_robot import SimulatedRobot
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.robot_run import PortRobot
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from tests.support.matrix_case import EQUATIONS, Case, ObservedRun, set_up
from tests.support.trials.row import Row

CODE = "wheel_runaway"
FALSE_CODES = (CODE, "wheel_direction")  # of the stops that no healthy robot may have
TWO_CHANNELS = (
    "robot.drive.encoder.channels=2",
    "robot.drive.left.encoder.pin_b=22",
    "robot.drive.right.encoder.pin_b=23",
)
HEALTHY = (
    "none",
    "missed_1",
    "doubled",
    "jitter",
    "battery_step",
    "sag",
    "gain",
    "lag",
    "start_duty",
    "slip",
    "backlash",
    "cogging",
)
ROBOTS = ("book_2wd", "book_2wd_counts", "book_2wd_stock")
SPEED_SHARES = (0.1, 0.45)  # commanded, of the full speed of the motors
FAULT_TIMES_S = (1.5, 5.0)
DRIVE_TIME_S = 30.0
LATE_S = 0.5  # beyond the bound: acceleration, delay of command and telemetry


class Runaway(NamedTuple):
    """One faulty run. `bound`: time (s) after which the sum must exceed what is allowed."""

    robot: str
    stopped: float
    bound: float
    named: bool


class StuckDriver(SimulatedRobotDriver):
    """A board that drives one wheel at full speed from `at` (s) on, until the host stops it."""

    def __init__(self, robot: SimulatedRobot, takes_duty: bool, side: str, at: float) -> None:
        super().__init__(robot, takes_duty)
        self.side, self.at, self.full = side, round(at * SECOND), 1.0
        self.wheel = robot.wheels[SIDES.index(side)]
        self.angles: list[tuple[int, float]] = []  # ns, rad: of the stuck wheel

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Send the command, with the full speed in the place of the stuck wheel's."""
        if now >= self.at and (command.left or command.right):
            left, right = command.left, command.right
            full = (self.full, right) if self.side == "left" else (left, self.full)
            command = self.command_class(command.time, *full)
            self.angles.append((now, self.wheel.angle))
        super().command(now, command)

    @property
    def stuck_speed(self) -> float:
        """Mean true speed (rad/s) of the stuck wheel until the host stopped it."""
        (begin, first), (end, last) = self.angles[0], self.angles[-1]
        return abs(last - first) / (end - begin) * SECOND


PIPELINE = """\
format: 1
kind: pipeline
robot: {in: {wheels: kinematics.wheels}}
blocks:
  straight:   {block: straight,   with: {speed: SPEED m/s}}
  kinematics: {block: diff_drive, in: {twist: straight.twist}}
"""


class Straight(Block):
    """Drive straight on, without looking: no other block notices a wheel that is too fast."""

    speed = Param(float, default=0.1, unit="m/s", above=0.0, help="Forward speed.")
    tick = Every(0.05)
    twist = Out(Twist)

    def react(self, now: int, tick: int | None) -> Twist | None:
        return Twist(now, self.speed, 0.0)


class StuckRun(Run):
    """A run whose board has one stuck motor driver."""

    def __init__(self, seed: int, robot: str, side: str, at: float, speed: float) -> None:
        self.fault = (side, at)
        options = RunOptions(seed=seed, fast=True, duration=DRIVE_TIME_S)
        with tempfile.TemporaryDirectory() as folder:
            configuration = _straight(robot, speed, Path(folder))
            super().__init__(configuration, options, tell=lambda text: None)

    def _open_robot(self) -> PortRobot:
        plain = super()._open_robot()
        driver, plant = plain.driver, plain.plant
        assert isinstance(driver, SimulatedRobotDriver) and plant is not None
        stuck = StuckDriver(plant, driver.command_class is Duty, *self.fault)
        robot = self.configuration.robot
        assert robot is not None
        if driver.command_class is Wheels:
            side = robot.drive.left if self.fault[0] == "left" else robot.drive.right
            stuck.full = side.motor.rated
        return PortRobot(stuck, plant)


def _straight(robot: str, speed: float, folder: Path) -> Configuration:
    pipeline = folder / "straight.yaml"
    pipeline.write_text(PIPELINE.replace("SPEED", repr(speed)))
    registry.BLOCKS["straight"] = f"{__name__}:Straight"
    try:
        return load(str(pipeline), robot, [])
    finally:
        del registry.BLOCKS["straight"]


def runaway(seed: int) -> Runaway:
    """One run with a wheel that turns at full speed; drawn from `seed`."""
    rng = Random(f"runaway {seed}")
    name, side = rng.choice(ROBOTS), rng.choice(SIDES)
    robot = load("goal", name, []).robot
    assert robot is not None
    wheel = robot.drive.left
    share = rng.uniform(*SPEED_SHARES)
    at = rng.uniform(*FAULT_TIMES_S)
    target = share * wheel.motor.rated
    run = StuckRun(seed, name, side, at, target * wheel.wheel.diameter / 2)
    result = run.go()
    gate, driver = run.assembly.graph.block("gate"), run.robots[0].robot
    assert isinstance(gate, Gate) and isinstance(driver, StuckDriver)
    stop = next((stop for stop in result.stops if stop.code == CODE), None)
    return Runaway(
        name,
        inf if stop is None else stop.time / SECOND - at,
        bound(gate.wheels_watched[side], target, driver.stuck_speed),
        stop is not None and stop.cause.startswith(f"the {side} wheel"),
    )


def bound(detector: OverspeedDetector, target: float, speed: float) -> float:
    """Time (s) in which a wheel at `speed` (rad/s) exceeds the sum that is allowed at `target`."""
    limit = detector.settled_limit_of(target)
    surplus = detector.counted_share * speed - limit
    if surplus <= 0.0:
        return inf
    return (detector.resolution + (detector.strongest - limit) * detector.settling) / surplus


def false_stop(seed: int, number: int) -> str:
    """The healthy run of this number, if it was stopped or refused; else an empty text."""
    try:
        return _false_stop(seed, number)
    except UserError as error:
        return f"robot {number} is refused: {error.problems[-1].cause}"


def _false_stop(seed: int, number: int) -> str:
    rng = Random(f"healthy {seed} {number}")
    if number % 4:
        name = HEALTHY[number % len(HEALTHY)]
        case = Case(seed, number, name, number % len(EQUATIONS) + 1, 0)
        with tempfile.TemporaryDirectory() as folder:
            run: Run = ObservedRun(set_up(case, Path(folder)))
            stops, text = run.go().stops, f"{case}"
    else:
        lag = rng.uniform(0.03, 0.4)
        sets = [
            "world.walls=[]",
            f"robot.simulation.equations={rng.choice(list(EQUATIONS.values()))}",
            f"robot.simulation.motor.lag=[{lag!r} s, {lag!r} s]",
            f"robot.simulation.motor.gain_spread={rng.uniform(0.0, 0.5)!r}",
            f"robot.simulation.battery.sag={rng.uniform(0.0, 0.4)!r}",
            f"robot.simulation.slip={rng.uniform(0.0, 3.0)!r} mm",
        ]
        x, y, heading = rng.uniform(-1.5, 1.5), rng.uniform(-1.5, 1.5), rng.uniform(-3.0, 3.0)
        options = RunOptions(
            goals=(Goal(0, 1, x, y, heading),), seed=number, fast=True, duration=60.0
        )
        robot = rng.choice(ROBOTS)
        if robot != "book_2wd_stock" and number % 8:
            sets += TWO_CHANNELS
        run = Run(load("goal", robot, sets), options, tell=lambda text: None)
        stops, text = run.go().stops, f"{robot} {sets}"
    return next((f"{text}: {stop.cause}" for stop in stops if stop.code in FALSE_CODES), "")


def rows(seed: int, healthy: int, faulty: int) -> Iterator[Row]:
    """`healthy` and `faulty` runs; false stops are printed."""
    with Pool() as pool:
        false = [text for text in pool.imap(partial(false_stop, seed), range(healthy), 4) if text]
        outcomes = pool.map(runaway, [seed * 100_000 + number for number in range(faulty)])
    for text in false:
        print(f"        {text}")
    yield Row(
        "healthy random robots stopped as runaway or reversed",
        f"{len(false)} of {healthy}",
        "0",
        not false,
    )
    in_time = sum(
        outcome.named and outcome.stopped <= outcome.bound + LATE_S for outcome in outcomes
    )
    worst = max(outcome.stopped for outcome in outcomes)
    longest = max(outcome.bound for outcome in outcomes)
    yield Row(
        "a wheel stuck at full speed: stopped and named",
        f"{in_time} of {faulty}, {worst:.1f} s",
        f"all, within the bound of each (up to {longest:.1f} s) + {LATE_S:g} s",
        in_time == faulty,
    )
