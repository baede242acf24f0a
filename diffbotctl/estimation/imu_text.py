"""The state of an IMU in words; one wording for all screens."""

from __future__ import annotations

from math import degrees
from typing import assert_never

from diffbotctl.messages import Imu


def imu_lines(imu: Imu) -> list[str]:
    """`+12.3 deg/s, scale calibrated` and `bias 0.123 +- 0.004 deg/s`, or why it is not used."""
    match imu.state:
        case "failed":
            return [f"FAULT: {imu.cause}"]
        case "zeroing":
            return ["not used yet: it is zeroed while the robot stands still"]
        case "working":
            scale = "calibrated" if imu.calibrated else "not calibrated"
            bias, sd = degrees(imu.bias), degrees(imu.bias_sd)
            rate = f"{degrees(imu.rate):+.1f} deg/s, scale {scale}"
            return [rate, f"bias {bias:.3f} +- {sd:.3f} deg/s"]
        case _:
            assert_never(imu.state)


def imu_text(imu: Imu) -> str:
    return ", ".join(imu_lines(imu))
