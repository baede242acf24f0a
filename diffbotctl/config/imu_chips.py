"""Chips with a gyro that the board reads: addresses, printed names of the pins, modules.

From the register map of the MPU6050 (revision 4.2) and the data sheets of the LSM6DS3 and LSM6DSO.
"""

from __future__ import annotations

from typing import NamedTuple

from diffbotctl.config.robot import ImuSection


class ImuChip(NamedTuple):
    """Addresses on the I2C bus with `address_pin` low and high; `supply_pin` of a usual module."""

    addresses: tuple[int, int]
    address_pin: str
    is_address_wired: bool  # also low: modules pull that pin up, or down
    supply_pin: str
    modules: str
    is_lsm6: bool = False


_MPU = ImuChip((104, 105), "AD0", False, "VCC", "pull-ups to its 3.3 V (GY-521, GY-9250)")
_LSM6 = ImuChip((106, 107), "SA0", True, "VIN", "level shifters (one with a pin VIN)", is_lsm6=True)
IMU_CHIPS: dict[str, ImuChip] = {
    "mpu6050": _MPU,
    "mpu6500": _MPU,
    "mpu9250": _MPU,
    "lsm6ds3": _LSM6,
    "lsm6dso": _LSM6,
}


def imu_address(imu: ImuSection) -> int:
    """The I2C address of an IMU that has a type."""
    return IMU_CHIPS[str(imu.type)].addresses[0] if imu.address is None else imu.address
