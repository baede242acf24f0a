"""What learning the encoders' discs buys: a straight metre and a turn, with each robot's own discs.

Each robot turns its lifted wheels once, and its discs are learnt from what its board told; then it
is switched on anew with both discs somewhere else under their light barriers, and drives.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, pi
from random import Random
from statistics import pstdev
from typing import NamedTuple

from diffbotctl.calibrate.slot_learning import Disc, Learning, learn_discs
from diffbotctl.config.configuration import Configuration
from diffbotctl.messages import Encoders, Goal, Wheels
from diffbotctl.plant.robot import SimulatedRobot
from diffbotctl.plant.wheel import Wheel
from diffbotctl.runs.run import Options, Run
from diffbotctl.runs.simulation import simulated
from prove.motion import LONGEST, configuration, turn
from prove.row import Row

MS = 1_000_000  # ns
REFRESH = 100 * MS  # the board's dead-man's stop wants to hear something
SPEED = 8.0  # rad/s of the lifted wheels
WAYS = ((0.3, 0.4), (0.3, 0.7), (10.0, 1.0), (1.0, 0.0))  # s, share of the speed; each way
LATERAL, HEADING = 5.0, 0.8  # mm, deg


class End(NamedTuple):
    """Where a robot truly came to rest: m, rad."""

    y: float
    heading: float
    error: float
    """rad, what odometry says more than the truth"""


def rows(seed: int, robots: int) -> Iterator[Row]:
    """Rows for robots with edge times and slip, whose discs are learnt."""
    chance = Random(f"{seed} slots")
    setup = configuration("edges")
    ahead, turned = Goal(0, 0, 1.0, 0.0, None), Goal(0, 0, 0.0, 0.0, pi / 2)
    metres, turns, before = [], [], []
    for _ in range(robots):
        robot = chance.getrandbits(32)
        forget(setup)
        before.append(drive(setup, turned, robot, chance))
        learn(setup, robot)
        metres.append(drive(setup, ahead, robot, chance))
        turns.append(drive(setup, turned, robot, chance))
    lateral = pstdev(each.y for each in metres) * 1000
    yield Row("slots learnt: straight metre, lateral sd", f"{lateral:.1f} mm",
              f"<= {LATERAL:g} mm", lateral <= LATERAL)  # fmt: skip
    for what, ends in (("metre", metres), ("90 degree turn", turns)):
        yield heading_row(f"{what}, odometry's heading sd", [each.error for each in ends])
    yield heading_row("90 degree turn, heading sd at the goal",
                      [turn(each.heading - pi / 2) for each in turns])  # fmt: skip
    spread = pstdev(degrees(each.error) for each in before)
    yield Row("slots not learnt: 90 degree turn, odometry's heading", f"{spread:.2f} deg",
              "(none)", True)  # fmt: skip


def heading_row(what: str, errors: list[float]) -> Row:
    """Standard deviation of some headings' errors (rad)."""
    spread = pstdev(degrees(each) for each in errors)
    return Row(f"slots learnt: {what}", f"{spread:.2f} deg", f"<= {HEADING:g} deg",
               spread <= HEADING)  # fmt: skip


def forget(setup: Configuration) -> None:
    """Nothing is known of the discs."""
    assert setup.robot is not None
    for side in (setup.robot.drive.left, setup.robot.drive.right):
        side.encoder.slot_errors = []
        side.encoder.back_errors = []


def learn(setup: Configuration, seed: int) -> tuple[Disc, Disc]:
    """Learn the discs of the robot that `seed` draws, and put them into the configuration."""
    robot = setup.robot
    assert robot is not None
    use = next(each for each in setup.blocks if each.name == "odometry")
    odometry = Learning(**use.values)
    odometry.reset()
    discs = learn_discs(odometry, lifted(simulated(setup, seed).robot))
    for side, disc in zip((robot.drive.left, robot.drive.right), discs, strict=True):
        side.encoder.slot_errors = list(disc.forward)
        side.encoder.back_errors = list(disc.backward)
    return discs


def lifted(robot: SimulatedRobot) -> Iterator[Encoders]:
    """What the board tells while both wheels turn forward, and then backward."""
    now = 0
    for way in (1.0, -1.0):
        for seconds, share in WAYS:
            speed, until = way * share * SPEED, now + int(seconds * 1000) * MS
            while now < until:
                robot.command(now, Wheels(now, speed, speed))
                now += REFRESH
                robot.advance(now)
                for port, message in robot.deliver():
                    if port == "encoders":
                        assert isinstance(message, Encoders)
                        yield message


def drive(setup: Configuration, goal: Goal, seed: int, chance: Random) -> End:
    """Where the robot that `seed` draws ends, started with its discs turned by chance."""
    run = Run(setup, Options(goals=(goal,), seed=seed, fast=True, duration=LONGEST))
    plant: SimulatedRobot = run.robot.robot  # type: ignore[union-attr]
    plant.wheels = tuple(
        Wheel(wheel.motor, disc._replace(start=chance.uniform(0.0, 2 * pi)),
              Random(chance.getrandbits(64)), falling=plant.machine.falling)
        for wheel, disc in zip(plant.wheels, plant.discs, strict=True)
    )  # fmt: skip
    result = run.go()
    pose = result.truth.pose
    return End(pose.y, pose.heading, turn(result.odometry.heading - pose.heading))
