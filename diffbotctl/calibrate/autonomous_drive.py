"""An outing on the floor: the robot drives itself to poses, watched, and comes to rest.

The blocks are those of every pipeline, without sensors: odometry, follower, limiter, kinematics,
and the last gate. Each outing begins at the origin of its own odom frame, where the robot stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf
from typing import Any, NamedTuple

from diffbotctl.blocks.diff_drive import DiffDrive
from diffbotctl.blocks.goal_follower import GoalFollower
from diffbotctl.blocks.odometry import OdometryBlock
from diffbotctl.blocks.speed_limiter import SpeedLimiter
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.robot_link import is_duty_board
from diffbotctl.engine.loop import Engine
from diffbotctl.errors import Problem, RunError
from diffbotctl.graph import Graph, Node, Sink
from diffbotctl.messages import Encoders, Goal, Odometry
from diffbotctl.runs.build_graph import (
    UNPROVEN_SPEED,
    build_block,
    gate_node,
    sources,
    wheel_speed_node,
)
from diffbotctl.time import SECOND

STOCK_TOLERANCE_M, STOCK_HEADING_TOLERANCE_RAD = (
    0.03,
    0.07,
)  # m, rad, of a board with the book's firmware
DRIVE_TIMEOUT_S = 180  # s an outing may take


class DriveStyle(NamedTuple):
    """How to drive."""

    speed: float = inf
    """m/s at most; the robot's own limit where that is less"""
    turn_rate: float = inf
    """rad/s, likewise"""
    acceleration: float = inf
    """m/s2, likewise"""
    near: float = 0.010
    """m, where a goal counts as reached"""
    facing: float = 0.035
    """rad, likewise"""
    method: str = "model"
    """of odometry"""


# Slow, as Borenstein and Feng ask, yet fast enough for every motor to run smoothly; gentle, so that
# no tyre slips. Where a goal really ended, odometry tells, so it need not be near.
CALIBRATION_STYLE = DriveStyle(speed=0.20, turn_rate=2.0, acceleration=0.5, near=0.015, facing=0.04)
DEFAULT_STYLE = DriveStyle()

Waypoint = tuple[float, float, float | None]
"""x, y in m and heading in rad, or none, in the frame of the start"""


def drive_to(
    rig: RobotSession,
    places: Sequence[Waypoint],
    reach: float,
    manner: DriveStyle = CALIBRATION_STYLE,
) -> Odometry:
    """Visit `places` one after the other; where odometry says that it came to rest.

    Raises RunError, with the robot stopped, when it cannot get there, goes further than `reach` m
    away from its start, or is stopped by a key, the board or the link.
    """
    rig.awake()
    goals = [Goal(0, 0, x, y, heading) for x, y, heading in places]
    return AutonomousDrive(rig, goals, reach, manner).go()


class AutonomousDrive:
    """One engine's run on the rig's robot."""

    def __init__(
        self, rig: RobotSession, goals: list[Goal], reach: float, manner: DriveStyle
    ) -> None:
        self.rig, self.reach = rig, reach
        self.pose: Odometry | None = None
        robot = rig.file.robot
        self.operator = Operator(goals, lambda code, cause: self.engine.end(code, cause))
        nodes, command = _pipeline(robot, manner)
        sinks: dict[str, list[Sink]] = {
            command: [self._send],
            "follower.state": [self.operator.hear_goal_state],
            "gate.stop": [self.operator.hear_stop("gate.stop"), self._held],
            "odometry.odometry": [self._watch],
            "robot.encoders": [self._record],
        }
        self.engine = Engine(
            Graph(nodes, sources(robot)),
            [rig.driver, self.operator],
            rig.clock,
            robot=rig.driver,
            sinks=sinks,
            signals=rig.keys,
        )

    def go(self) -> Odometry:
        """Raises RunError."""
        self.operator.at = self.rig.now  # an engine's time starts at 0, the rig's went on
        self.engine.last = self.rig.now
        try:
            ending = self.engine.run(self.rig.now + DRIVE_TIMEOUT_S * SECOND)
        finally:
            self.rig.now = max(self.rig.now, self.engine.last)
        if ending.stopped is False:
            fix = "switch the motors' battery off before you look for the cause"
            raise self._failed("the board did not confirm that it has stopped", fix)
        if self.engine.failure is not None:
            raise self.engine.failure
        if self.operator.reached < self.operator.number or self.pose is None:
            raise self._failed(ending.cause, "")
        return self.pose

    def _failed(self, cause: str, fix: str) -> RunError:
        return RunError(Problem("E-CALIBRATE-STOPPED", "calibrate", cause, fix))

    def _send(self, now: int, wanted: Any) -> None:
        if self.engine.ending is None:
            self.rig.driver.command(now, wanted)

    def _record(self, now: int, frame: Encoders) -> None:
        self.rig.note(now, frame)

    def _held(self, now: int, stop: Any) -> None:
        """Nobody resumes in a calibration: what holds the robot ends the outing."""
        if stop.code and stop.latched:
            self.engine.end(1, stop.cause)

    def _watch(self, now: int, pose: Odometry) -> None:
        self.pose = pose
        if hypot(pose.x, pose.y) > self.reach:
            self.engine.end(1, f"it went further than the {self.reach:.1f} m that were announced")


def _pipeline(robot: Robot, manner: DriveStyle) -> tuple[list[Node], str]:
    """The pipeline, and the wire that leaves for the robot."""
    limits = robot.limits
    most = UNPROVEN_SPEED if robot.drive.polarity == "unproven" else inf
    held = {
        "speed": min(limits.speed, manner.speed, most),
        "turn_rate": min(limits.turn_rate, manner.turn_rate),
        "acceleration": min(limits.acceleration, manner.acceleration),
    }
    near, facing = manner.near, manner.facing
    if is_duty_board(robot):  # its counts, late and few, tell no nearer
        near, facing = max(near, STOCK_TOLERANCE_M), max(facing, STOCK_HEADING_TOLERANCE_RAD)
    ends = {"tolerance": near, "heading_tolerance": facing}
    odometry = build_block(OdometryBlock, robot, method=manner.method)
    to_goal = {"odometry": "odometry.odometry", "goal": "operator.goal", "stop": "operator.stop"}
    nodes = [
        Node("odometry", odometry, {"encoders": "robot.encoders"}),
        Node("follower", build_block(GoalFollower, robot, **ends, **held), to_goal),
        Node("limiter", build_block(SpeedLimiter, robot, **held), {"twist": "follower.twist"}),
        Node("kinematics", build_block(DiffDrive, robot), {"twist": "limiter.twist"}),
        gate_node(robot, "kinematics.wheels"),
    ]
    if not is_duty_board(robot):
        return nodes, "gate.wheels"
    return [*nodes, wheel_speed_node(robot)], "wheel_speed.duty"
