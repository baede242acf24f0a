"""`calibrate imu`: the axis of the gyro that points up, and its scale, from turns on the spot.

The axis that turns with the wheels is the vertical one. The board reads one axis at a time, so the
robot turns once for each, at most three times. Whether it points up or down is shown by lifting the
robot by hand; without that by its sign, if the directions of the motors are proven.

The bias is the rate at rest before and after a spin. What is left of it adds to the turn in one
direction what it takes from it in the other.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import acos, degrees, pi
from typing import Any

from diffbotctl.calibrate.confidence import robust_mean
from diffbotctl.calibrate.end_answers import FACING
from diffbotctl.calibrate.imu_mounting import (
    find_direction,
    lift_action,
    read_axis,
    refuse_faulty,
    rest_rate,
    turn_between,
)
from diffbotctl.calibrate.result import GYRO_AXES, GYRO_SCALE, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import (
    Event,
    Message,
    Outcome,
    StepProgress,
    StepRun,
    counted,
    marked_motion,
)
from diffbotctl.calibrate.steps.spin import REACH_M, TURN_RATE_RAD_S, spin_command
from diffbotctl.config.robot import ImuSection, Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Encoders
from diffbotctl.prompts.question import ExpectedQuestion, MarkFloor, MotionNotice, floor_drives

SPIN_FACING = replace(FACING, name="imu.facing")
TURNS_PER_SPIN = 10
SETTLE_TIME_S = 0.5  # a wheel with few slots creeps on unseen
REST_TIME_S = 3.0
READING_SD_RATIO = 0.0003  # one degree in ten turns
SCALE_SD_MIN = 0.001  # 3 K: the scale of an MPU6050 varies by 2 % over 65 K (data sheet)
AXIS_SHARE_MIN = 0.5  # of the commanded turn; about a horizontal axis a gyro measures nearly none
SCALE_ERROR_MAX = 0.03  # of a gyro that is mounted level (data sheets)
ASKEW_MIN_DEG = 8.0  # a module on its screws is level within 5
LIFTS_MAX = 2


@dataclass(frozen=True, slots=True)
class ImuStep:
    """The step: `turns` in each direction, `repeats` times; `lift`: have the robot lifted."""

    turns: int = TURNS_PER_SPIN
    repeats: int = 1
    lift: bool = True
    name: str = "imu"
    title: str = "axis and scale of the gyro, from turns on the spot"
    lifted: bool = False

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """The lifts, and the heading after each spin."""
        if robot.imu.type is None:
            return [ExpectedQuestion(SPIN_FACING, 0)]
        questions = [
            *floor_drives(self.name, 2 * self.repeats),
            ExpectedQuestion(SPIN_FACING, 2 * self.repeats),
        ]
        return [*questions, ExpectedQuestion(lift_action("front"))] if self.lift else questions

    def run(self, session: RobotSession) -> StepRun:
        """Find the axis, then turn and have the final heading measured, to the left and right."""
        session.connect()
        imu = session.file.robot.imu
        if imu.type is None:
            return Outcome("spin", [], ["the robot file has no IMU"], is_recorded=False)
        stated = imu.axes
        try:
            axes = yield from self._find_axes(session)
        except RunError:
            session.note_findings([Finding(GYRO_AXES, stated)])  # not the one that was read last
            raise
        read_axis(session, axes)
        if axes != stated:
            yield Message(f"{axis_text(axes)}. The robot file has axes: {stated}; it is corrected.")
        imu = session.file.robot.imu
        times = f", {self.repeats} times" if self.repeats > 1 else ""
        yield _notice(f"{self.turns} turns to the left and {self.turns} to the right{times}")
        scales = []
        for number in range(2 * self.repeats):
            yield StepProgress("turning on the spot", number, 2 * self.repeats)
            scales.append((yield from self._spin(session, imu, number)))
        scale = robust_mean(scales, READING_SD_RATIO)
        sd = max(scale.sd, SCALE_SD_MIN)
        line = f"scale of the gyro: {imu.scale:.4f} before, {scale.value:.4f} now, +- {2 * sd:.4f}"
        findings, report = [Finding(GYRO_SCALE, scale.value, sd)], [f"{line} (95 %)"]
        report += askew_report(scale.value)
        if axes == stated:
            return Outcome("spin", findings, [f"axes of the IMU: {axes}, as stated", *report])
        report.insert(0, f"axes of the IMU: {stated} before, {axes} now")
        return Outcome("spin", [Finding(GYRO_AXES, axes), *findings], report)

    def _find_axes(self, session: RobotSession) -> Generator[Event, Any, str]:
        """The axis that points up, with its sign. Raises RunError if it cannot be found."""
        yield _notice("once to the left, at most three times, to find the vertical axis of the IMU")
        by_turn = yield from _find_vertical(session)
        if not self.lift:
            return by_turn_alone(by_turn, session.file.robot)
        by_lift = ""
        for number in range(LIFTS_MAX):
            if number:
                yield Message(f"{contradiction(by_lift, by_turn)} Lift it once more.")
            by_lift = yield from find_direction(session, by_turn[-1])
            if by_lift == by_turn:
                return by_lift
        raise wrong_turn(by_lift, by_turn, session.file.robot)

    def _spin(
        self, session: RobotSession, imu: ImuSection, number: int
    ) -> Generator[Event, Any, float]:
        """True turn divided by measured turn, by one spin; every other one is clockwise."""
        side = "right" if number % 2 else "left"
        mark = MarkFloor(
            counted(number, 2 * self.repeats, "Mark the floor beside both tyres."),
            f"it turns {self.turns} times to the {side}, on the spot",
        )
        angle = (-1 if number % 2 else 1) * 2 * pi * self.turns
        measured = yield from marked_motion(
            session, mark, partial(_turn_on_the_spot, session, angle)
        )
        refuse_wrong_axis(measured, angle, imu.axes)
        facing = float((yield SPIN_FACING))
        return (facing + 2 * pi * round((imu.scale * measured - facing) / (2 * pi))) / measured


def _notice(turns: str) -> MotionNotice:
    text = (
        f"The robot turns on the spot: {turns}. It stands still for {REST_TIME_S:g} s before and "
        f"after each, and stays within {REACH_M:g} m of its position. Do not touch it meanwhile."
    )
    return MotionNotice("imu", text, reach=REACH_M)


def _find_vertical(session: RobotSession) -> Generator[Event, Any, str]:
    """The axis that turns with the wheels, with the sign with which it turns to the left.

    Raises RunError if none does.
    """
    stated, angle = session.file.robot.imu.axes, 2 * pi
    candidates = [stated, *(axis for axis in "xyz" if axis != stated[-1])]
    for number, axes in enumerate(candidates):
        yield StepProgress("looking for the vertical axis", number, len(candidates))
        read_axis(session, axes)
        measured = _turn_on_the_spot(session, angle)
        if abs(measured) >= AXIS_SHARE_MIN * angle:
            return axes if measured > 0.0 else opposite_axis(axes)
    raise no_axis_turns(angle)


def by_turn_alone(axes: str, robot: Robot) -> str:
    """The axis that a turn has shown, with its sign.

    Raises RunError if it has the other sign in the robot file, and the motors may be exchanged.
    """
    stated = robot.imu.axes
    if axes == opposite_axis(stated) and not is_direction_known(robot):
        refuse_wrong_axis(-2 * pi, 2 * pi, stated)
    return axes


def contradiction(by_lift: str, by_turn: str) -> str:
    """What lifts and a turn say of the axis that points up."""
    return (
        f"By the lifts {axis_text(by_lift)[0].lower()}{axis_text(by_lift)[1:]}, and by the turn to "
        f"the left it points {'down' if by_turn.startswith('-') else 'up'}."
    )


def wrong_turn(by_lift: str, by_turn: str, robot: Robot) -> RunError:
    """The error for a robot that turned to the right instead of the left, by the lifts."""
    fix = "if the front and the left side were lifted, the motors turn the robot to the right: "
    fix += "`diffbotctl calibrate encoders` corrects that"
    if is_direction_known(robot):
        fix += "; their directions were proven before, so look at its wires"
    return RunError(Problem("E-CALIBRATE-ROBOT", "imu", contradiction(by_lift, by_turn), fix))


def askew_report(scale: float) -> list[str]:
    """A line about an IMU that is mounted askew: no gyro measures so little of a turn."""
    tilt = degrees(acos(min((1.0 + SCALE_ERROR_MAX) / scale, 1.0)))
    if tilt < ASKEW_MIN_DEG:
        return []
    return [
        f"the gyro measures {100 / scale:.0f} % of each turn: it is mounted askew by "
        f"{tilt:.0f} deg or more. Screw it down flat and repeat this step"
    ]


def no_axis_turns(angle: float) -> RunError:
    """The error for an IMU of which no axis turns as the wheels do, by `angle` (rad)."""
    cause = (
        f"the wheels turned the robot by {degrees(angle):.0f} deg, and the gyro measured less than "
        f"{degrees(AXIS_SHARE_MIN * angle):.0f} deg about each of its axes"
    )
    fix = (
        "something holds the robot, its wheels slip, or the IMU is mounted askew: one of its axes "
        "must point up or down"
    )
    return RunError(Problem("E-CALIBRATE-ROBOT", "imu", cause, fix))


def is_direction_known(robot: Robot) -> bool:
    """Whether a turn to the left is one: else motors may be exchanged, and not the IMU turned."""
    return robot.drive.polarity != "unproven"


def opposite_axis(axes: str) -> str:
    """`-x` for `x`, and the reverse."""
    return axes.removeprefix("-") if axes.startswith("-") else f"-{axes}"


def axis_text(axes: str) -> str:
    """Which printed axis points up or down."""
    direction = "down" if axes.startswith("-") else "up"
    return f"The axis {axes[-1]} printed on the IMU points {direction}"


def _turn_on_the_spot(session: RobotSession, angle: float) -> float:
    """The turn (rad) that the gyro measures of one by `angle`, without its bias."""
    before = session.listen(REST_TIME_S).encoders
    command = spin_command(session.file.robot, 1 if angle > 0 else -1)
    between = session.run_for(command, abs(angle) / TURN_RATE_RAD_S).encoders
    between += session.stop_and_wait().encoders + session.listen(SETTLE_TIME_S).encoders
    after = session.listen(REST_TIME_S).encoders
    refuse_faulty([*before, *between, *after])
    return measured_turn(before, after)


def measured_turn(before: Sequence[Encoders], after: Sequence[Encoders]) -> float:
    """The turn (rad) between two rests, without the mean of their rates."""
    bias = 0.5 * (rest_rate(before) + rest_rate(after))
    return turn_between(before, after, bias)


def refuse_wrong_axis(measured: float, commanded: float, axes: str) -> None:
    """Raises RunError unless `measured` is a turn about `axes` like the `commanded` one (rad)."""
    share = measured / commanded
    if share >= AXIS_SHARE_MIN:
        return
    if share <= -AXIS_SHARE_MIN:
        cause = f"the gyro measures the turns with the wrong sign: axes is {axes}"
        fix = (
            f"set `imu: {{axes: {opposite_axis(axes)}}}`, if both motors turn in the right "
            "direction: `diffbotctl calibrate encoders` shows it"
        )
    else:
        cause = (
            f"the gyro measured {degrees(measured):.0f} deg about {axes[-1]}, and the wheels "
            f"{degrees(commanded):.0f} deg"
        )
        fix = "something holds the robot, or its wheels slip; put it on a level, clean floor"
    raise RunError(Problem("E-CALIBRATE-ROBOT", "imu", cause, fix))
