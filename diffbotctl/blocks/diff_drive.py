"""From the body's velocity to the wheels' speeds."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Twist, Wheels
from diffbotctl.params import FromRobot


class DiffDrive(Block):
    """Turn a body velocity into two wheel speeds within what the motors can do.

    When a wheel would have to turn faster than rated, both are slowed alike: the path stays, only
    the time on it grows.
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
        return Wheels(twist.time, *scale_to_rated(left, right, self.left_rated, self.right_rated))


def wheel_speeds(
    linear: float, angular: float, track: float, left_diameter: float, right_diameter: float
) -> tuple[float, float]:
    """Wheel speeds (rad/s) that give `linear` (m/s) and `angular` (rad/s)."""
    aside = 0.5 * angular * track
    return 2.0 * (linear - aside) / left_diameter, 2.0 * (linear + aside) / right_diameter


def scale_to_rated(
    left: float, right: float, left_max: float, right_max: float
) -> tuple[float, float]:
    """Both speeds scaled by one factor so that neither exceeds its most; their ratio is kept."""
    over = max(abs(left) / left_max, abs(right) / right_max)
    return (left, right) if over <= 1.0 else (left / over, right / over)
