"""`calibrate geometry --how spin`: the track, from turns on the spot in both directions."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import partial
from math import copysign, degrees, hypot, pi, radians
from typing import Any

from diffbotctl.blocks.odometry import OdometryBlock
from diffbotctl.calibrate.confidence import robust_mean
from diffbotctl.calibrate.contradiction import ask_checked
from diffbotctl.calibrate.dead_reckoning import wrap_angle
from diffbotctl.calibrate.end_answers import FACING, ZeroReadings, angle_contradiction
from diffbotctl.calibrate.known_lengths import known_scale_sd, rest_sd, with_scale
from diffbotctl.calibrate.result import TRACK, Finding
from diffbotctl.calibrate.session import RobotSession, WheelCommand
from diffbotctl.calibrate.step import Event, Outcome, StepProgress, StepRun, counted, marked_motion
from diffbotctl.calibrate.steps.squares import scale_report
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_ports import wheel_command
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Encoders
from diffbotctl.prompts.question import ExpectedQuestion, MarkFloor, MotionNotice, floor_drives
from diffbotctl.runs.build_graph import build_block

TURNS_PER_SPIN = 10
TURN_RATE_RAD_S = 1.5  # ten turns in 42 s
LISTEN_TIME_S = 0.1
TRACK_SD_RATIO = 0.0003  # one degree in ten turns
FIRST_ERROR_MAX, DIFFERENCE_MAX = radians(60), radians(20)  # of what odometry missed
AMBIGUOUS_ERROR_MIN = radians(120)  # the rest of a turn is twice as likely as usual from here on
REACH_M = 0.1  # a robot that turns on the spot drifts a little
MM = 1000.0


@dataclass(frozen=True, slots=True)
class SpinStep:
    """The step: `turns` in each direction, `repeats` times."""

    turns: int = TURNS_PER_SPIN
    repeats: int = 2
    name: str = "geometry"
    title: str = "the track, from turns on the spot"
    lifted: bool = False

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        return [
            *floor_drives(self.name, 2 * self.repeats),
            ExpectedQuestion(FACING, 2 * self.repeats),
        ]

    def run(self, session: RobotSession) -> StepRun:
        """Turn and have the final heading measured, in alternating directions."""
        session.connect()
        yield MotionNotice(
            self.name,
            f"The robot turns on the spot: {self.turns} turns to the left and {self.turns} to the "
            f"right, {self.repeats} times. It stays within {REACH_M:g} m of its position.",
            reach=REACH_M,
        )
        zeros = ZeroReadings(2 * self.repeats, "the heading after a spin")
        errors: list[float] = []
        ratios = []
        for number in range(2 * self.repeats):
            yield StepProgress("turning on the spot", number, 2 * self.repeats)
            direction = -1 if number % 2 else 1
            odometry = yield from self._spin(session, direction, number)
            facing = yield from _ask_facing(odometry, direction, errors)
            zeros.add(facing)
            ratios.append(odometry / (odometry + direction * errors[-1]))
        ratio = robust_mean(ratios, TRACK_SD_RATIO)
        track = session.file.robot.drive.track
        line = (
            f"track: {track * MM:.3f} mm before, {track * ratio.value * MM:.3f} mm now, "
            f"+- {track * ratio.half_width * MM:.3f} mm (95 %)"
        )
        # Turns determine the track in multiples of the mean diameter.
        rolled = pi * track * self.turns
        rest = rest_sd(session.file.robot) / rolled
        robot, found = session.file.robot, track * ratio.value
        sds = with_scale(found, hypot(ratio.sd, rest), known_scale_sd(robot))
        return Outcome("spin", [Finding(TRACK, found, *sds)], [line, *scale_report(robot)])

    def _spin(
        self, session: RobotSession, direction: int, number: int
    ) -> Generator[Event, Any, float]:
        """The heading (rad, unwrapped) of odometry after one spin; 1 is counter-clockwise."""
        side = "left" if direction > 0 else "right"
        mark = MarkFloor(
            counted(number, 2 * self.repeats, "Mark the floor beside both tyres."),
            f"it turns {self.turns} times to the {side}, on the spot",
        )
        robot = session.file.robot
        command = spin_command(robot, direction)

        def turn() -> list[Encoders]:
            frames = session.listen(LISTEN_TIME_S).encoders
            frames += session.run_for(command, 2 * pi * self.turns / TURN_RATE_RAD_S).encoders
            return frames + session.stop_and_wait().encoders

        return _dead_reckoned_heading(robot, (yield from marked_motion(session, mark, turn)))


def _ask_facing(
    odometry: float, direction: int, errors: list[float]
) -> Generator[Event, Any, float]:
    """The measured heading (rad); the turn that odometry missed in `direction` is added to
    `errors`. Raises RunError where that could also be a part of another turn."""
    check = partial(
        angle_contradiction,
        expected=odometry,
        before=[direction * error for error in errors],
        first_max=FIRST_ERROR_MAX,
        other_max=DIFFERENCE_MAX,
    )
    facing = yield from ask_checked(FACING, check)
    errors.append(direction * wrap_angle(facing - odometry))
    if abs(errors[-1]) > AMBIGUOUS_ERROR_MIN:
        raise _ambiguous_turn(odometry, errors[-1])
    return facing


def _ambiguous_turn(odometry: float, error: float) -> RunError:
    tracks = sorted(
        100 * (abs(odometry) / (abs(odometry) + each) - 1)
        for each in (error, error - copysign(2 * pi, error))
    )
    cause = (
        f"after {abs(odometry) / (2 * pi):.1f} turns by its wheels the robot faces "
        f"{degrees(abs(error)):.0f} deg away from there: the track may differ by "
        f"{tracks[0]:+.1f} % or by {tracks[1]:+.1f} % from the one in the robot file"
    )
    fix = (
        "measure the track with a ruler between the middles of the tyres, correct `drive.track`, "
        "and run this step again; or drive squares"
    )
    return RunError(Problem("E-CALIBRATE-ROBOT", "geometry", cause, fix))


def spin_command(robot: Robot, direction: int) -> WheelCommand:
    """The command for a turn on the spot; 1 is counter-clockwise."""
    drive = robot.drive
    rim_speed = direction * TURN_RATE_RAD_S * drive.track
    return wheel_command(
        robot, -rim_speed / drive.left.wheel.diameter, rim_speed / drive.right.wheel.diameter
    )


def _dead_reckoned_heading(robot: Robot, frames: Sequence[Encoders]) -> float:
    """The heading (rad, unwrapped) of the wheels' odometry after these frames."""
    block = build_block(OdometryBlock, robot, imu=None)
    block.reset()
    pose = None
    for frame in frames:
        reaction = block.react(frame.time, frame)
        pose = (reaction and reaction[0]) or pose
    assert pose is not None
    return pose.heading
