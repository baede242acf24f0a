"""`calibrate imu`: the axis of the gyro that points up, and its scale, from turns on the spot.

The axis that turns with the wheels is the vertical one; one of which the sign differs points down.
The board reads one axis at a time, so the robot turns once for each, at most three times.

The bias is the rate at rest before and after a spin. What is left of it adds to the turn in one
direction what it takes from it in the other.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from math import degrees, pi
from typing import Any

from diffbotctl.calibrate.confidence import robust_mean
from diffbotctl.calibrate.result import GYRO_AXES, GYRO_SCALE, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import Event, Message, Outcome, StepProgress, StepRun
from diffbotctl.calibrate.steps.spin import REACH_M, TURN_RATE_RAD_S, spin_command
from diffbotctl.calibrate.steps.squares import FACING
from diffbotctl.config.robot import ImuSection, Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_faults import GYRO_FIX
from diffbotctl.messages import Encoders
from diffbotctl.prompts.question import MarkFloor, MotionNotice

TURNS_PER_SPIN = 10
SETTLE_TIME_S = 0.5  # a wheel with few slots creeps on unseen
REST_TIME_S = 3.0
READING_SD_RATIO = 0.0003  # one degree in ten turns
SCALE_SD_MIN = 0.001  # 3 K: the scale of an MPU6050 varies by 2 % over 65 K (data sheet)
AXIS_SHARE_MIN = 0.5  # of the commanded turn; about a horizontal axis a gyro measures nearly none
NS = 1e-9  # s


@dataclass(frozen=True, slots=True)
class ImuStep:
    """The step: `turns` in each direction, `repeats` times."""

    turns: int = TURNS_PER_SPIN
    repeats: int = 1
    name: str = "imu"
    title: str = "axis and scale of the gyro, from turns on the spot"
    lifted: bool = False

    def run(self, session: RobotSession) -> StepRun:
        """Turn and have the final heading measured, in alternating directions."""
        session.connect()
        imu = session.file.robot.imu
        if imu.type is None:
            return Outcome("spin", [], ["the robot file has no IMU"])
        times = f", {self.repeats} times" if self.repeats > 1 else ""
        yield MotionNotice(
            f"The robot turns on the spot: once to the left, at most three times, to find the axis "
            f"of the IMU that points up; then {self.turns} turns to the left and {self.turns} to "
            f"the right{times}. It stands still for {REST_TIME_S:g} s before and after each, and "
            f"stays within {REACH_M:g} m of its position. Do not touch it meanwhile.",
            reach=REACH_M,
        )
        stated, axes = imu.axes, (yield from _find_axes(session))
        imu = session.file.robot.imu
        scales = []
        for number in range(2 * self.repeats):
            yield StepProgress("turning on the spot", number, 2 * self.repeats)
            scales.append((yield from self._spin(session, imu, -1 if number % 2 else 1)))
        scale = robust_mean(scales, READING_SD_RATIO)
        sd = max(scale.sd, SCALE_SD_MIN)
        line = f"scale of the gyro: {imu.scale:.4f} before, {scale.value:.4f} now, +- {2 * sd:.4f}"
        findings, report = [Finding(GYRO_SCALE, scale.value, sd)], [f"{line} (95 %)"]
        if axes == stated:
            return Outcome("spin", findings, [f"axes of the IMU: {axes}, as stated", *report])
        report.insert(0, f"axes of the IMU: {stated} before, {axes} now")
        return Outcome("spin", [Finding(GYRO_AXES, axes), *findings], report)

    def _spin(
        self, session: RobotSession, imu: ImuSection, direction: int
    ) -> Generator[Event, Any, float]:
        """True turn divided by measured turn, by one spin; 1 is counter-clockwise."""
        yield MarkFloor("Mark the floor beside both tyres.")
        angle = direction * 2 * pi * self.turns
        measured = _turn_on_the_spot(session, angle)
        refuse_wrong_axis(measured, angle, imu.axes)
        facing = float((yield replace(FACING, name="imu.facing")))
        return (facing + 2 * pi * round((imu.scale * measured - facing) / (2 * pi))) / measured


def _find_axes(session: RobotSession) -> Generator[Event, Any, str]:
    """The axis that points up, with the sign; the session continues with it.

    Raises RunError if none turns as the wheels do.
    """
    stated, angle, measured = session.file.robot.imu.axes, 2 * pi, 0.0
    candidates = [stated, *(axis for axis in "xyz" if axis != stated[-1])]
    for number, axes in enumerate(candidates):
        yield StepProgress("looking for the vertical axis", number, len(candidates))
        _read_axis(session, axes)
        measured = _turn_on_the_spot(session, angle)
        if abs(measured) >= AXIS_SHARE_MIN * angle:
            break
    else:
        _read_axis(session, stated)
        raise no_axis_turns(angle)
    if measured < 0.0 and is_direction_known(session.file.robot):
        axes, measured = opposite_axis(axes), -measured
    _read_axis(session, axes if measured > 0.0 else stated)
    refuse_wrong_axis(measured, angle, axes)
    if axes != stated:
        yield Message(f"{axis_text(axes)}. The robot file has axes: {stated}; it is corrected.")
    return axes


def _read_axis(session: RobotSession, axes: str) -> None:
    if session.file.robot.imu.axes != axes:
        session.try_findings([Finding(GYRO_AXES, axes)])
        session.connect()


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
    bias = 0.5 * (_rate(before) + _rate(after))
    first, last = before[-1], after[0]
    return _turn(last) - _turn(first) - bias * (last.time - first.time) * NS


def refuse_faulty(frames: Sequence[Encoders]) -> None:
    """Raises RunError if the gyro has failed, or if the board reports none."""
    for frame in frames:
        fault = frame.turn_fault
        if frame.turn is None:
            fault = fault or "the board reports no turn of the IMU"
        if fault:
            raise RunError(Problem("E-IMU-FAULT", "calibrate imu", fault, GYRO_FIX))


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


def _rate(rest: Sequence[Encoders]) -> float:
    """The rate at rest, rad/s."""
    return (_turn(rest[-1]) - _turn(rest[0])) / ((rest[-1].time - rest[0].time) * NS)


def _turn(frame: Encoders) -> float:
    assert frame.turn is not None
    return frame.turn
