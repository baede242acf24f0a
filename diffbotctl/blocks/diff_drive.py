"""Inverse kinematics of the differential drive: body velocity to wheel speeds."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Twist, Wheels
from diffbotctl.params import FromRobot

# rad/s, half of the least speed that a frame to the board can carry. In a turn about a wheel,
# rounding leaves less than this of its speed: a board that takes a float would apply the duty that
# overcomes the friction.
SPEED_MIN = 1.0 / 512.0


class DiffDrive(Block):
    """Convert a body velocity into two wheel speeds within the rated speeds of the motors.

    If a wheel exceeds its rated speed, both are scaled by one factor, which keeps the path.
    """

    track: float = FromRobot("drive.track")
    left_diameter: float = FromRobot("drive.left.wheel.diameter")
    right_diameter: float = FromRobot("drive.right.wheel.diameter")
    left_rated: float = FromRobot("drive.left.motor.rated")
    right_rated: float = FromRobot("drive.right.motor.rated")
    twist = In(Twist)
    wheels = Out(Wheels)

    def react(self, now: int, twist: Twist | None) -> Wheels | None:
        if twist is None:
            return None
        left, right = wheel_speeds(
            twist.linear, twist.angular, self.track, self.left_diameter, self.right_diameter
        )
        left, right = scale_to_rated(left, right, self.left_rated, self.right_rated)
        return Wheels(twist.time, _without_rounding(left), _without_rounding(right))


def wheel_speeds(
    linear: float, angular: float, track: float, left_diameter: float, right_diameter: float
) -> tuple[float, float]:
    """Wheel speeds (rad/s) for `linear` (m/s) and `angular` (rad/s); lengths in m."""
    aside = 0.5 * angular * track
    return 2.0 * (linear - aside) / left_diameter, 2.0 * (linear + aside) / right_diameter


def scale_to_rated(
    left: float, right: float, left_max: float, right_max: float
) -> tuple[float, float]:
    """Both speeds scaled by one factor so that neither exceeds its maximum."""
    over = max(abs(left) / left_max, abs(right) / right_max)
    return (left, right) if over <= 1.0 else (left / over, right / over)


def _without_rounding(speed: float) -> float:
    return speed if abs(speed) >= SPEED_MIN else 0.0
