"""Autonomous drives on the floor: the robot drives to poses under supervision, and stops.

The blocks are those of every pipeline, without sensors: odometry, follower, limiter, kinematics and
the safety gate. Each drive begins at the origin of its own odom frame, where the robot stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf
from typing import Any, NamedTuple

from diffbotctl.blocks.diff_drive import DiffDrive
from diffbotctl.blocks.goal_follower import GoalFollower
from diffbotctl.blocks.odometry import OdometryBlock
from diffbotctl.blocks.speed_limiter import SpeedLimiter
from diffbotctl.calibrate.session import KeyStopError, RobotSession, stopped_error
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.robot_ports import is_duty_board
from diffbotctl.engine.clock import Clock, PacedClock
from diffbotctl.engine.instant_monitor import InstantLimits, instant_limits
from diffbotctl.engine.loop import Engine
from diffbotctl.graph import Graph, Node, Sink
from diffbotctl.messages import Goal, Odometry
from diffbotctl.runs.build_graph import (
    UNPROVEN_SPEED_MAX,
    build_block,
    gate_node,
    sources,
    wheel_speed_node,
)
from diffbotctl.time import SECOND

STOCK_TOLERANCE_M, STOCK_HEADING_TOLERANCE_RAD = 0.03, 0.07  # of a board with the book's firmware
DRIVE_TIMEOUT_NS = 180 * SECOND
REACH_MARGIN_RATIO = 0.25  # of a distance, for a wrong wheel diameter


class DriveStyle(NamedTuple):
    """How to drive. The robot's own limits apply where they are lower."""

    speed: float = inf  # m/s, maximum
    turn_rate: float = inf  # rad/s, maximum
    acceleration: float = inf  # m/s2, maximum
    tolerance: float = 0.010  # m, of a goal
    heading_tolerance: float = 0.035  # rad, of a goal
    method: str = "model"  # of odometry


# Slow, as Borenstein and Feng ask, yet fast enough for every motor to run smoothly; gentle, so that
# no tyre slips. Odometry measures where the drive really ended, so tolerances may be wide.
CALIBRATION_STYLE = DriveStyle(0.20, 2.0, 0.5, tolerance=0.015, heading_tolerance=0.04)
DEFAULT_STYLE = DriveStyle()

Waypoint = tuple[float, float, float | None]
"""x, y in m and heading in rad or None, in the frame of the start"""


def reach_of(distance: float) -> float:
    """How far (m) a robot may go that is to drive `distance`."""
    return distance * (1 + REACH_MARGIN_RATIO)


def drive_to(
    session: RobotSession,
    waypoints: Sequence[Waypoint],
    reach: float,
    style: DriveStyle = CALIBRATION_STYLE,
) -> Odometry:
    """Drive to the waypoints in order. Returns the pose of odometry at the end.

    Raises RunError, with the robot stopped, if it does not get there, leaves the circle of radius
    `reach` (m) around its start, or is stopped by a key, the board or the link.
    """
    session.catch_up()
    goals = [Goal(0, 0, x, y, heading) for x, y, heading in waypoints]
    return AutonomousDrive(session, goals, reach, style).run()


class AutonomousDrive:
    """One run of an engine with the robot of the session."""

    def __init__(
        self, session: RobotSession, goals: list[Goal], reach: float, style: DriveStyle
    ) -> None:
        self.session, self.reach = session, reach
        self.pose: Odometry | None = None
        robot = session.file.robot
        self.operator = Operator(goals, lambda code, cause: self.engine.end(code, cause))
        nodes, command = _pipeline(robot, style)
        sinks: dict[str, list[Sink]] = {
            command: [self._on_command],
            "follower.state": [self.operator.on_goal_state],
            "gate.stop": [self.operator.stop_sink("gate.stop"), self._on_stop],
            "odometry.odometry": [self._on_pose],
            "robot.encoders": [session.on_frame],
        }
        self.engine = Engine(
            Graph(nodes, sources(robot)),
            [session.driver, self.operator],
            session.clock,
            robot=session.driver,
            sinks=sinks,
            signals=session.key,
            limits=_instant_limits(robot, session.clock),
        )

    def run(self) -> Odometry:
        """Raises RunError."""
        session, engine = self.session, self.engine
        self.operator.outbox_due = engine.last_instant = (
            session.now
        )  # the time of an engine starts at 0
        try:
            outcome = engine.run(session.now + DRIVE_TIMEOUT_NS)
        finally:
            session.now = max(session.now, engine.last_instant)
        if outcome.stopped is False:
            fix = "switch the motor battery off before you look for the cause"
            raise stopped_error("the board did not confirm that it has stopped", fix)
        if engine.failure is not None:
            raise engine.failure
        if session.key is not None and session.key.cause:
            raise KeyStopError(session.key.cause)
        # An uncertain pose is enough: the person measures where the robot is.
        arrived = self.operator.reached + self.operator.reached_unsure
        if arrived < self.operator.number or self.pose is None:
            raise stopped_error(outcome.cause, "")
        return self.pose

    def _on_command(self, now: int, command: Any) -> None:
        if self.engine.ending is None and not self.engine.stop_waits:
            self.session.driver.command(now, command)

    def _on_stop(self, now: int, stop: Any) -> None:
        """A latched stop ends the drive: a calibration has no way to resume."""
        if stop.code and stop.latched:
            self.engine.end(1, stop.cause)

    def _on_pose(self, now: int, pose: Odometry) -> None:
        self.pose = pose
        if hypot(pose.x, pose.y) > self.reach:
            self.engine.end(1, f"it went further than the announced {self.reach:.1f} m")


def _instant_limits(robot: Robot, clock: Clock) -> InstantLimits | None:
    """Limits of the time that an instant may take; a simulated robot waits for this program."""
    if not isinstance(clock, PacedClock):
        return None
    return instant_limits(robot.board.deadman, robot.board.telemetry, is_real=True)


def _pipeline(robot: Robot, style: DriveStyle) -> tuple[list[Node], str]:
    """The blocks, and the wire with the command for the robot."""
    limits = robot.limits
    speed = UNPROVEN_SPEED_MAX if robot.drive.polarity == "unproven" else inf
    motion = {
        "speed": min(limits.speed, style.speed, speed),
        "turn_rate": min(limits.turn_rate, style.turn_rate),
        "acceleration": min(limits.acceleration, style.acceleration),
    }
    tolerances = {"tolerance": style.tolerance, "heading_tolerance": style.heading_tolerance}
    if is_duty_board(robot):  # few and late counts do not allow less
        tolerances = {
            "tolerance": max(style.tolerance, STOCK_TOLERANCE_M),
            "heading_tolerance": max(style.heading_tolerance, STOCK_HEADING_TOLERANCE_RAD),
        }
    # With a gyro, the odometry would not show the errors of the wheels that are measured.
    odometry = build_block(OdometryBlock, robot, method=style.method, imu=None)
    inputs = {"odometry": "odometry.odometry", "goal": "operator.goal", "stop": "operator.stop"}
    nodes = [
        Node("odometry", odometry, {"encoders": "robot.encoders"}),
        Node("follower", build_block(GoalFollower, robot, **tolerances, **motion), inputs),
        Node("limiter", build_block(SpeedLimiter, robot, **motion), {"twist": "follower.twist"}),
        Node("kinematics", build_block(DiffDrive, robot), {"twist": "limiter.twist"}),
        gate_node(robot, "kinematics.wheels"),
    ]
    if not is_duty_board(robot):
        return nodes, "gate.wheels"
    return [*nodes, wheel_speed_node(robot)], "wheel_speed.duty"
