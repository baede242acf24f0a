"""Wheel speeds as the board takes them: as they are, or as the duty that should give them."""

from __future__ import annotations

from diffbotctl.config.robot import MotorSection, Robot
from diffbotctl.control.speed_loop import limit_duty, speed_gains
from diffbotctl.drivers.robot_link import is_duty_board
from diffbotctl.messages import Duty, Wheels


def wheels(robot: Robot, left: float, right: float) -> Wheels | Duty:
    """The command for wheel speeds in rad/s.

    A board without speed loops gets the feed-forward's duty; nothing corrects it.
    """
    if not is_duty_board(robot):
        return Wheels(0, left, right)
    drive = robot.drive
    return Duty(0, _duty(drive.left.motor, left), _duty(drive.right.motor, right))


def _duty(motor: MotorSection, speed: float) -> float:
    return limit_duty(speed_gains(motor).duty(speed), speed)
