"""Wheel speeds as the board takes them: as they are, or as the duty that should give them."""

from __future__ import annotations

from math import copysign

from diffbotctl.config.robot import Robot, SideSection
from diffbotctl.control.speed_loop import speed_gains
from diffbotctl.drivers.robot_link import is_duty_board
from diffbotctl.messages import Duty, Wheels


def wheels(robot: Robot, left: float, right: float) -> Wheels | Duty:
    """The command for wheel speeds in rad/s.

    A board without speed loops gets the feed-forward's duty; nothing corrects it.
    """
    if not is_duty_board(robot):
        return Wheels(0, left, right)
    return Duty(0, _duty(robot.drive.left, left), _duty(robot.drive.right, right))


def _duty(side: SideSection, speed: float) -> float:
    if not speed:
        return 0.0
    ahead = speed_gains(side.motor)
    return copysign(min(ahead.static + ahead.slope * abs(speed), 1.0), speed)
