"""Parts of common kits that a robot file cannot name: what comes nearest, and what to write.

A misspelt name is recognised too, unless an allowed value is nearer.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import SequenceMatcher
from typing import NamedTuple

NAME_CUTOFF = 0.75  # similarity of a misspelt name


class UnsupportedPart(NamedTuple):
    """A part that is not supported: why, and what to write."""

    cause: str
    fix: str


def _board(title: str, difference: str) -> UnsupportedPart:
    cause = f"our firmware does not run on {title}: {difference}"
    fix = "use a Mega 2560, Uno, Nano or Pico; without one simulate: board: {type: simulated}"
    return UnsupportedPart(cause, fix)


def _same_imu(title: str, kind: str) -> UnsupportedPart:
    return UnsupportedPart(f"the gyro of {title} is that of an {kind.upper()}", f"write {kind}")


def _other_imu(title: str) -> UnsupportedPart:
    cause = f"{title} has other registers than the IMUs that our firmware reads"
    return UnsupportedPart(cause, "use a module with an mpu6050 (GY-521) or an lsm6dso")


OTHER_DRIVE = UnsupportedPart(
    "only two driven wheels, or four that are switched in pairs, are supported",
    "four wheels in skid steering: write differential, with wheelbase: the distance of the axles, "
    "and track: the one at which it turns (`check` estimates it, `calibrate spin` measures it)",
)
LASER = UnsupportedPart(
    "the robot file has only the place of a laser scanner, as lds01, and simulates that one",
    "write type: lds01 and pin: none; a pipeline reads it at a USB port: `sources`, driver: lidar",
)
# By the last part of the field's path and the name in small letters without punctuation.
PARTS: dict[str, dict[str, UnsupportedPart]] = {
    "board.type": {
        "esp32": _board("an ESP32", "the sketch for its chip has never run on one"),
        "esp8266": _board("an ESP8266", "its chip has no firmware here"),
        "rp2040": UnsupportedPart("an RP2040 is the chip of a Pico", "write type: pico"),
        "pico2": _board("a Pico 2", "its chip, the RP2350, has no firmware here"),
        "rp2350": _board("an RP2350", "it has no firmware here"),
        "due": _board("a Due", "its chip, the SAM3X, has no firmware here"),
        "nanoevery": _board("a Nano Every", "its chip, the 4809, has no firmware here"),
        "teensy": _board("a Teensy", "its chip has no firmware here"),
        "leonardo": _board("a Leonardo", "its chip, the 32U4, has no firmware here"),
        "32u4": _board("a 32U4 (Leonardo, Romi)", "the chip has no firmware here"),
        "stm32": _board("an STM32", "the chip has no firmware here"),
        "raspberrypi": UnsupportedPart(
            "a Raspberry Pi is the computer that runs diffbotctl, not the board that it drives",
            "name the board that is connected to it: mega2560, uno, nano or pico",
        ),
    },
    "drive.type": {
        name: OTHER_DRIVE
        for name in ("skidsteer", "fourwheel", "tank", "mecanum", "omni", "ackermann", "tricycle")
    },
    "imu.type": {
        "gy521": _same_imu("a GY-521", "mpu6050"),
        "gy9250": _same_imu("a GY-9250", "mpu9250"),
        "mpu9150": _same_imu("an MPU9150", "mpu6050"),
        "lsm6ds33": _same_imu("an LSM6DS33", "lsm6ds3"),
        "lsm6dsox": _same_imu("an LSM6DSOX", "lsm6dso"),
        "bno055": _other_imu("a BNO055"),
        "bno085": _other_imu("a BNO085"),
        "icm20948": _other_imu("an ICM20948"),
        "bmi160": _other_imu("a BMI160"),
        "bmi270": _other_imu("a BMI270"),
        "l3gd20": _other_imu("an L3GD20"),
    },
    "sensors.type": {
        "vl53l0x": UnsupportedPart(
            "a VL53L0X is read over I2C, from which our firmware reads no distances",
            "use a GP2Y0A41 (type: sharp_gp2y0a41sk0f), which measures 4 to 30 cm, or an HC-SR04",
        ),
        "rplidar": LASER,
        "ydlidar": LASER,
    },
}


def unsupported_part(field: str, written: str, allowed: Iterable[str]) -> UnsupportedPart | None:
    """The part that `written` names in a field of a robot file, such as `imu.type`."""
    parts = PARTS.get(field)
    if parts is None:
        return None
    name = _normal(written)
    values = [_normal(value) for value in allowed]
    if any(value.startswith(name) for value in values):
        return None
    # Part numbers have suffixes: GP2Y0A21YK0F.
    for known, part in parts.items():
        if name.startswith(known) or (len(name) > 3 and known.startswith(name)):
            return part
    # A misspelt one with a suffix is compared without what exceeds the known name.
    similarity = {known: _similarity(name[: len(known)], known) for known in parts}
    similarity |= {value: _similarity(name, value) for value in values}
    nearest = max(similarity, key=lambda known: similarity[known])
    return parts.get(nearest) if similarity[nearest] >= NAME_CUTOFF else None


def _normal(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower()[:80]).removeprefix("sharp")


def _similarity(one: str, other: str) -> float:
    return SequenceMatcher(None, one, other).ratio()
