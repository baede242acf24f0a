"""Checks of the inertial sensor: what reads it, and how fast the robot may turn."""

from __future__ import annotations

from math import degrees, floor, radians

from diffbotctl.config.checks.context import CheckContext
from diffbotctl.links.diffbot_frames import GYRO_MAXIMUM

# Of the gyro's full scale: a turn overshoots its limit, and bias and scale take their part.
USABLE_RATIO = 0.9
TURN_RATE_MAX = USABLE_RATIO * radians(GYRO_MAXIMUM)


def check_imu(context: CheckContext) -> None:
    """Refuse an IMU that nothing reads, or that the robot's turns exceed."""
    values = context.values("imu.type", "link.protocol", "limits.turn_rate", "board.type")
    if values is None or values[0] is None:
        return
    kind, protocol, turn_rate, _ = values
    if protocol != "diffbot":
        cause = f"the book's firmware does not read an {kind}"
        fix = "install ours, `diffbotctl flash firmware`, and set protocol: diffbot; or remove imu"
        context.error("E-IMU-USE", context.robot_place("imu", "type"), cause, fix)
    if turn_rate > TURN_RATE_MAX:
        cause = (
            f"the robot may turn at {degrees(turn_rate):.0f} deg/s, and the gyro measures up to "
            f"{GYRO_MAXIMUM} deg/s"
        )
        fix = f"set turn_rate to at most {floor(10.0 * TURN_RATE_MAX) / 10.0:.1f} rad/s"
        place = context.error_place("limits.turn_rate", "imu.type")
        context.error("E-IMU-USE", place, cause, fix)
