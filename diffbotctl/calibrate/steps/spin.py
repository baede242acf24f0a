"""`calibrate geometry --how spin`: the track alone, from ten turns on the spot each way."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

from diffbotctl.blocks.odometry import OdometryBlock
from diffbotctl.calibrate.confidence import robust_mean
from diffbotctl.calibrate.result import TRACK, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import Event, MarkFloor, MotionNotice, Outcome, Running, StepProgress
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_link import wheel_command
from diffbotctl.messages import Encoders, Odometry
from diffbotctl.prompts.question import FACING
from diffbotctl.runs.build_graph import build_block

TURNS_PER_SPIN = 10
TURN_RATE_RAD_S = 1.5  # rad/s; ten turns in 42 s
TRACK_SD_RATIO = 0.0003  # of the track: one degree of ten turns
REACH_M = 0.1  # m; a robot that turns on the spot wanders a little
MM = 1000.0


@dataclass(frozen=True, slots=True)
class SpinStep:
    """The step: `turns` each way, `repeats` times."""

    turns: int = TURNS_PER_SPIN
    repeats: int = 2
    name: str = "geometry"
    title: str = "the track, by turning on the spot"
    lifted: bool = False

    def run(self, rig: RobotSession) -> Running:
        """Turn, have it read how far it really came, the other way; as often as wanted."""
        rig.meet()
        yield MotionNotice(
            f"The robot turns on the spot, {self.turns} times round and back again, "
            f"{self.repeats} times. It stays within {REACH_M:g} m of where it stands.",
            reach=REACH_M,
        )
        ratios = []
        for number in range(self.repeats):
            for way in (1, -1):
                yield StepProgress("turning on the spot", 2 * number + (way < 0), 2 * self.repeats)
                ratios.append((yield from self._once(rig, way)))
        found = robust_mean(ratios, TRACK_SD_RATIO)
        track = rig.file.robot.drive.track
        finding = Finding(TRACK, track * found.value, track * found.sd)
        line = (
            f"track: {track * MM:.3f} mm before, {track * found.value * MM:.3f} mm found, "
            f"+- {track * found.half * MM:.3f} mm (95 %)"
        )
        return Outcome("spin", [finding], [line])

    def _once(self, rig: RobotSession, way: int) -> Generator[Event, Any, float]:
        """What the track must be multiplied by, by one spin."""
        yield MarkFloor("Mark the floor beside both tyres.")
        robot = rig.file.robot
        rim = way * TURN_RATE_RAD_S * robot.drive.track
        drive = robot.drive
        command = wheel_command(
            robot, -rim / drive.left.wheel.diameter, rim / drive.right.wheel.diameter
        )
        frames = rig.listen(0.1).encoders
        frames += rig.hold(command, 2 * pi * self.turns / TURN_RATE_RAD_S).encoders
        frames += rig.rest().encoders
        told = dead_reckoned_end(robot, frames).heading
        facing = yield FACING
        true = float(facing) + 2 * pi * round((told - float(facing)) / (2 * pi))
        return told / true


def dead_reckoned_end(robot: Robot, frames: Sequence[Encoders]) -> Odometry:
    """Where odometry says that these frames have led, from the origin."""
    block = build_block(OdometryBlock, robot)
    block.reset()
    pose = None
    for frame in frames:
        pose = block.react(frame.time, frame) or pose
    assert pose is not None
    return pose
