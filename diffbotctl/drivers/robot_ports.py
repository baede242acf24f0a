"""What the ports and the board of a robot take, without importing any protocol.

Simulated runs import this module; the protocols of real boards are in robot_link.
"""

from __future__ import annotations

import os
import stat

from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.load import load_robot
from diffbotctl.config.robot import Robot
from diffbotctl.control.speed_loop import limit_duty, speed_gains
from diffbotctl.messages import Duty, Wheels

GYRO_REST = 1_000_000_000  # ns; wheels with few slots coast unseen in the first third of it
# Ports without a real robot, each with how screens mark it
VIRTUAL_PORTS = {"sim": "SIMULATED", "emulated": "SIMULATED robot, EMULATED board"}
# Of the device file of an emulated board; it has no meaning for a device, so no other one has it.
EMULATED_MODE = stat.S_ISVTX


def mark_emulated(device: str) -> None:
    """Mark the pseudo-terminal `device` as the port of an emulated board."""
    os.chmod(device, os.stat(device).st_mode | EMULATED_MODE)


def is_simulated_port(port: str) -> bool:
    """Whether a simulated robot is behind `port`: also behind the device of `emulate`."""
    if port in VIRTUAL_PORTS:
        return True
    try:
        mode = os.stat(port).st_mode
    except (OSError, ValueError):
        return False
    return stat.S_ISCHR(mode) and bool(mode & EMULATED_MODE)


def load_robot_at(port: str, robot: str | None) -> RobotFile:
    """`load_robot`; raises ConfigurationError for results of a simulated robot at a real `port`."""
    return load_robot(robot, refuse_simulated=not is_simulated_port(port))


def is_duty_board(robot: Robot) -> bool:
    """True for a board that takes a duty: it has no wheel-speed loop, or no encoders for it."""
    return robot.link.protocol == "rosserial" or not has_encoders(robot)


def goal_rest(robot: Robot | None) -> int:
    """Time (ns) between one goal and the next, in which a gyro is zeroed."""
    return 0 if robot is None or robot.imu.type is None else GYRO_REST


def has_encoders(robot: Robot) -> bool:
    """False for motors without encoders."""
    return bool(robot.drive.left.encoder.channels)


def wheel_command(robot: Robot, left: float, right: float) -> Wheels | Duty:
    """The command for wheel speeds in rad/s, as the board takes them.

    A board without speed loops gets the feed-forward's duty; nothing corrects it.
    """
    if not is_duty_board(robot):
        return Wheels(0, left, right)
    left_motor, right_motor = robot.drive.left.motor, robot.drive.right.motor
    return Duty(
        0,
        limit_duty(speed_gains(left_motor).duty(left), left),
        limit_duty(speed_gains(right_motor).duty(right), right),
    )
