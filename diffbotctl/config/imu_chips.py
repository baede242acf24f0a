"""Chips with a gyro that the board reads: addresses, printed names of the pins, modules.

The rows are in parts/imus.yaml.
"""

from __future__ import annotations

from typing import NamedTuple

from diffbotctl import parts


class ImuChip(NamedTuple):
    """Addresses on the I2C bus with `address_pin` low and high; `supply_pin` of a usual module."""

    addresses: tuple[int, int]
    address_pin: str
    is_address_wired: bool  # also low: modules pull that pin up, or down
    supply_pin: str
    modules: str
    is_lsm6: bool = False

    def address(self, written: int | None) -> int:
        """The address that a robot file states, or the one with the pin low."""
        return self.addresses[0] if written is None else written


IMU_CHIPS = {name: ImuChip(**row) for name, row in parts.rows("imus").items()}
