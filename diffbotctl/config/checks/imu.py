"""Checks of the inertial sensor: what reads it, and how fast the robot may turn."""

from __future__ import annotations

from math import degrees, floor, radians

from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.imu_chips import IMU_CHIPS
from diffbotctl.links.diffbot_frames import GYRO_MAXIMUM

# Of the gyro's full scale: a turn overshoots its limit, and bias and scale take their part.
USABLE_RATIO = 0.9
TURN_RATE_MAX = USABLE_RATIO * radians(GYRO_MAXIMUM)


@check("imu.type", "link.protocol", "limits.turn_rate", "board.type")
def check_imu(
    context: CheckContext, kind: str, protocol: str, turn_rate: float, board: str
) -> None:
    """Refuse an IMU that nothing reads, that has another address, or that turns exceed."""
    if protocol != "diffbot":
        cause = f"the book's firmware does not read an {kind}"
        fix = "install ours, `diffbotctl flash firmware`, and set protocol: diffbot; or remove imu"
        context.error("E-IMU-USE", context.robot_place("imu", "type"), cause, fix)
    _check_address(context, kind)
    if turn_rate > TURN_RATE_MAX:
        cause = (
            f"the robot may turn at {degrees(turn_rate):.0f} deg/s, and the gyro measures up to "
            f"{GYRO_MAXIMUM} deg/s"
        )
        fix = f"set turn_rate to at most {floor(10.0 * TURN_RATE_MAX) / 10.0:.1f} rad/s"
        place = context.error_place("limits.turn_rate", "imu.type")
        context.error("E-IMU-USE", place, cause, fix)


def _check_address(context: CheckContext, kind: str) -> None:
    values, (low, high) = context.values("imu.address"), IMU_CHIPS[kind].addresses
    if values is not None and values[0] not in (None, low, high):
        pin = IMU_CHIPS[kind].address_pin
        cause = f"an {kind} has the I2C address {low} or {high}, not {values[0]}"
        fix = f"remove address, or set it to {low} ({pin} at GND) or {high} ({pin} at 3.3 V)"
        context.error("E-IMU-USE", context.error_place("imu.address", "imu.type"), cause, fix)
