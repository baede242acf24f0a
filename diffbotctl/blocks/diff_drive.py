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
    rated: float = FromRobot("drive.left.motor.rated")
    twist = In(Twist)
    wheels = Out(Wheels)

    def react(self, now: int, twist: Twist | None) -> Wheels | None:
        if twist is None:
            return None
        left, right = wheel_speeds(
            twist.linear, twist.angular, self.track, self.left_diameter, self.right_diameter
        )
        return Wheels(twist.time, *saturated(left, right, self.rated))


def wheel_speeds(
    linear: float, angular: float, track: float, left_diameter: float, right_diameter: float
) -> tuple[float, float]:
    """Wheel speeds (rad/s) that give `linear` (m/s) and `angular` (rad/s)."""
    aside = 0.5 * angular * track
    return 2.0 * (linear - aside) / left_diameter, 2.0 * (linear + aside) / right_diameter


def saturated(left: float, right: float, most: float) -> tuple[float, float]:
    """Both speeds scaled by one factor so that neither exceeds `most`; their ratio is kept."""
    fastest = max(abs(left), abs(right))
    if fastest <= most:
        return left, right
    return left * most / fastest, right * most / fastest
