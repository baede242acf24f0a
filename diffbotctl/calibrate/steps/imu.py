"""`calibrate imu`: the scale of the gyro, from turns on the spot in both directions.

The bias is the rate at rest before and after a spin. What is left of it adds to the turn in one
direction what it takes from it in the other.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from math import degrees, pi
from typing import Any

from diffbotctl.calibrate.confidence import robust_mean
from diffbotctl.calibrate.result import GYRO_SCALE, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import Event, Outcome, StepProgress, StepRun
from diffbotctl.calibrate.steps.spin import REACH_M, TURN_RATE_RAD_S, spin_command
from diffbotctl.calibrate.steps.squares import FACING
from diffbotctl.config.robot import ImuSection
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
    title: str = "the scale of the gyro, from turns on the spot"
    lifted: bool = False

    def run(self, session: RobotSession) -> StepRun:
        """Turn and have the final heading measured, in alternating directions."""
        session.connect()
        imu = session.file.robot.imu
        if imu.type is None:
            return Outcome("spin", [], ["the robot file has no IMU"])
        times = f", {self.repeats} times" if self.repeats > 1 else ""
        yield MotionNotice(
            f"The robot turns on the spot: {self.turns} turns to the left and {self.turns} to the "
            f"right{times}. It stands still for {REST_TIME_S:g} s before and after each, and stays "
            f"within {REACH_M:g} m of its position. Do not touch it meanwhile.",
            reach=REACH_M,
        )
        scales = []
        for number in range(2 * self.repeats):
            yield StepProgress("turning on the spot", number, 2 * self.repeats)
            scales.append((yield from self._spin(session, imu, -1 if number % 2 else 1)))
        scale = robust_mean(scales, READING_SD_RATIO)
        sd = max(scale.sd, SCALE_SD_MIN)
        line = f"scale of the gyro: {imu.scale:.4f} before, {scale.value:.4f} now, +- {2 * sd:.4f}"
        return Outcome("spin", [Finding(GYRO_SCALE, scale.value, sd)], [f"{line} (95 %)"])

    def _spin(
        self, session: RobotSession, imu: ImuSection, direction: int
    ) -> Generator[Event, Any, float]:
        """True turn divided by measured turn, by one spin; 1 is counter-clockwise."""
        yield MarkFloor("Mark the floor beside both tyres.")
        angle = direction * 2 * pi * self.turns
        before = session.listen(REST_TIME_S).encoders
        between = session.run_for(
            spin_command(session.file.robot, direction), abs(angle) / TURN_RATE_RAD_S
        ).encoders
        between += session.stop_and_wait().encoders + session.listen(SETTLE_TIME_S).encoders
        after = session.listen(REST_TIME_S).encoders
        refuse_faulty([*before, *between, *after])
        measured = measured_turn(before, after)
        refuse_wrong_axis(measured, angle, imu.axes)
        facing = float((yield replace(FACING, name="imu.facing")))
        return (facing + 2 * pi * round((imu.scale * measured - facing) / (2 * pi))) / measured


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
    axis = axes.removeprefix("-")
    if share <= -AXIS_SHARE_MIN:
        up = axis if axes.startswith("-") else f"-{axis}"
        cause = f"the gyro measures the turns with the wrong sign: axes is {axes}"
        fix = f"set `imu: {{axes: {up}}}`, if both motors turn in the right direction"
    else:
        cause = (
            f"the gyro measured {degrees(measured):.0f} deg about {axis}, and the wheels "
            f"{degrees(commanded):.0f} deg"
        )
        fix = (
            "set `axes` to the axis printed on the IMU that points up; if that is the case, "
            "something holds the robot, or its wheels slip"
        )
    raise RunError(Problem("E-CALIBRATE-ROBOT", "imu", cause, fix))


def _rate(rest: Sequence[Encoders]) -> float:
    """The rate at rest, rad/s."""
    return (_turn(rest[-1]) - _turn(rest[0])) / ((rest[-1].time - rest[0].time) * NS)


def _turn(frame: Encoders) -> float:
    assert frame.turn is not None
    return frame.turn
