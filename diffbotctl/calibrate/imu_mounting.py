"""How an IMU is mounted, by lifting the robot by hand: which way its vertical axis points.

The robot turns about an axis across when a hand lifts its front, and about another one when it
lifts its left side. The printed axes are right-handed, so what the gyro measures of both shows
which way the third axis points, whatever the motors do, and however the IMU is turned about it.

The board reads one axis at a time: one on the way up, the other one on the way down. What the gyro
measures at rest is known from the floor, before the way up and after the way down.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from math import degrees, hypot, radians
from typing import Any

from diffbotctl.calibrate.contradiction import ATTEMPTS_MAX
from diffbotctl.calibrate.result import GYRO_AXES, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import Event, Message
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_states import gyro_fix
from diffbotctl.messages import Encoders
from diffbotctl.prompts.question import ManualAction

LIFT_RAD = radians(25.0)  # a hand's width at the end of a small robot
LIFT_MIN_RAD = radians(10.0)
LIFT_MAX_RAD = radians(80.0)
# Sine of the angle between the axes of both lifts, 90 degrees on a robot that is lifted as asked.
SINE_MIN = 0.6
FLOOR_TIME_S = 1.5
HELD_TIME_S = 0.5
NS = 1e-9  # s
Lift = tuple[float, float]
"""turn (rad) about the two axes of the gyro after the vertical one, in the order x, y, z"""


def find_direction(session: RobotSession, axis: str) -> Generator[Event, Any, str]:
    """Which way the printed `axis` (`x`, `y` or `z`), the vertical one, points: `z` or `-z`.

    The session then reads another axis. Raises RunError if the lifts show nothing.
    """
    front = yield from _lift(session, axis, "front")
    left = yield from _lift(session, axis, "left")
    return direction_of(axis, front, left)


def direction_of(axis: str, front: Lift, left: Lift) -> str:
    """The vertical `axis` with its sign, by the turns of both lifts.

    Raises RunError if they are turns about one axis.
    """
    # The left side goes up about the axis forward, the front against the one to the left.
    sine = (left[1] * front[0] - left[0] * front[1]) / (hypot(*front) * hypot(*left))
    if abs(sine) < SINE_MIN:
        cause = (
            "lifting the front turned the gyro about nearly the same axis as lifting the left side"
        )
        fix = (
            "lift the front of the robot, and put it down; then its left side. Or leave it out: "
            "`calibrate imu --no-lift`"
        )
        raise RunError(Problem("E-CALIBRATE-ROBOT", "imu", cause, fix))
    return axis if sine > 0.0 else f"-{axis}"


def _lift(session: RobotSession, axis: str, side: str) -> Generator[Event, Any, Lift]:
    """Have a side of the robot lifted and put down."""
    for _ in range(ATTEMPTS_MAX):
        turns = yield from _lift_once(session, axis, side)
        if LIFT_MIN_RAD <= hypot(*turns) <= LIFT_MAX_RAD:
            return turns
        yield Message(
            f"The gyro measured {degrees(hypot(*turns)):.0f} deg. Lift the {side} by a hand's "
            "width, without turning the robot, and hold it still."
        )
    cause = f"lifting the {side} of the robot did not turn the gyro by 10 to 80 deg"
    fix = "lift it by a hand's width, or leave it out: `calibrate imu --no-lift`"
    raise RunError(Problem("E-CALIBRATE-ROBOT", "imu", cause, fix))


def _lift_once(session: RobotSession, axis: str, side: str) -> Generator[Event, Any, Lift]:
    vertical = "xyz".index(axis)
    read_axis(session, "xyz"[(vertical + 1) % 3])
    floor = session.listen(FLOOR_TIME_S).encoders
    yield lift_action(side)
    held = session.listen(HELD_TIME_S).encoders
    refuse_faulty([*floor, *held])
    up = turn_between(floor, held, rest_rate(floor))
    read_axis(session, "xyz"[(vertical + 2) % 3])
    held = session.listen(HELD_TIME_S).encoders
    yield ManualAction(f"imu.put_down_{side}", "Put it down again.", lift=(side, 0.0))
    floor = session.listen(FLOOR_TIME_S).encoders
    refuse_faulty([*held, *floor])
    # The rate at rest is that on the floor: a hand is not as still.
    return up, -turn_between(held, floor, rest_rate(floor))


def lift_action(side: str) -> ManualAction:
    return ManualAction(
        f"imu.lift_{side}",
        f"Lift the {'front' if side == 'front' else 'left side'} of the robot by a hand's width, "
        "and hold it still.",
        lift=(side, LIFT_RAD),
    )


def turn_between(before: Sequence[Encoders], after: Sequence[Encoders], bias: float) -> float:
    """The turn (rad) from one rest to another, of a gyro that measures `bias` (rad/s) at rest."""
    first, last = before[-1], after[0]
    return turn_of(last) - turn_of(first) - bias * (last.time - first.time) * NS


def read_axis(session: RobotSession, axes: str) -> None:
    """Let the board read this axis from now on."""
    if session.file.robot.imu.axes != axes:
        session.try_findings([Finding(GYRO_AXES, axes)])
        session.connect()


def refuse_faulty(frames: Sequence[Encoders]) -> None:
    """Raises RunError if the gyro has failed, or if the board reports none."""
    for frame in frames:
        fault = frame.turn_fault
        if frame.turn is None:
            fault = fault or "the board reports no turn of the IMU"
        if fault:
            raise RunError(Problem("E-IMU-FAULT", "calibrate imu", fault, gyro_fix(fault)))


def rest_rate(rest: Sequence[Encoders]) -> float:
    """The rate at rest, rad/s."""
    return (turn_of(rest[-1]) - turn_of(rest[0])) / ((rest[-1].time - rest[0].time) * NS)


def turn_of(frame: Encoders) -> float:
    """The sum of the gyro in a frame that has one, rad."""
    assert frame.turn is not None
    return frame.turn
