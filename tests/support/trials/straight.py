"""How straight a robot drives when a client commands it, as `drive --v 0.15 --for 6s` does."""

from __future__ import annotations

from math import degrees
from typing import NamedTuple

from diffbotctl.config.load import load
from diffbotctl.engine.driver import Delivery
from diffbotctl.messages import Twist
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import MILLISECOND, NEVER, SECOND

SPEED = 0.15  # m/s
START, END, REST = 1 * SECOND, 7 * SECOND, 9 * SECOND  # ns; six seconds of driving, then rest
COMMAND_PERIOD = 50 * MILLISECOND  # as `drive` repeats its command


class StraightClient:
    """A driver that delivers the commands of a client which drives straight for six seconds."""

    def __init__(self) -> None:
        self.next = START

    def due(self) -> int:
        return self.next if self.next <= END else NEVER

    def files(self) -> list[int]:
        return []

    def deliver(self, now: int) -> list[Delivery]:
        speed = SPEED if self.next < END else 0.0
        self.next += COMMAND_PERIOD
        return [Delivery("operator.twist", Twist(now, speed, 0.0))]

    def close(self) -> None: ...


class StraightDrive(NamedTuple):
    """Change of the heading (deg) over one drive: estimated, actual, and the part of the actual one
    that follows from unequal wheel diameters, which odometry cannot see."""

    estimated: float
    actual: float
    diameters: float


def straight_drive(robot: str, seed: int, *sets: str, pipeline: str = "standby") -> StraightDrive:
    """Drive straight for six seconds with the robot that `seed` draws."""
    polarity = "robot.drive.polarity=checked_by_hand"
    setup = load(pipeline, robot, ["world.walls=[]", polarity, *sets])
    options = RunOptions(seed=seed, fast=True, stay=True, duration=REST / SECOND)
    run = Run(setup, options, tell=lambda text: None)
    run.engine.drivers.append(StraightClient())
    result = run.go()
    assert result.odometry is not None and result.truth is not None and run.plant is not None
    body, truth = run.plant.chassis, result.truth
    left, right = truth.left_angle, truth.right_angle
    nominal = setup.nominal
    assert nominal is not None
    sides = nominal.drive
    nominal_turn = (
        0.5 * (sides.right.wheel.diameter * right - sides.left.wheel.diameter * left)
    ) / sides.track
    rolled_turn = (body.right_radius * right - body.left_radius * left) / body.track
    return StraightDrive(
        degrees(result.odometry.heading),
        degrees(truth.pose.heading),
        degrees(rolled_turn - nominal_turn),
    )
