"""USB identities of boards, of the serial chips of clones, and of devices that are no board.

The rows are in usb_ids.yaml.
"""

from __future__ import annotations

from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple


class PortRole(StrEnum):
    """What a port or a USB device leads to."""

    BOARD = "board"  # one that our firmware runs on
    CHIP = "chip"  # a serial chip of a clone, or of any other device
    OTHER_PROGRAM = "other_program"  # a board that our firmware runs on, with another program
    OTHER_BOARD = "other_board"
    DFU = "dfu"
    NO_BOARD = "no_board"
    UNKNOWN = "unknown"
    BLUETOOTH = "bluetooth"
    ONBOARD = "onboard"


class UsbChip(NamedTuple):
    """What a USB identity stands for."""

    title: str
    role: PortRole
    module: str = "cdc_acm"  # the kernel's driver that makes a serial port of it; "" if none does
    board: str | None = None  # `board.type` of the robot file


RASPBERRY_PI = 0x2E8A
BOOTSEL = (RASPBERRY_PI, 0x0003)  # a Pico that shows its boot drive; it has no serial port


@cache
def usb_rows() -> list[dict[str, Any]]:
    """The rows of the table."""
    import yaml  # slow to import, and most commands open no port

    text = Path(__file__).with_name("usb_ids.yaml").read_text(encoding="utf-8")
    rows: list[dict[str, Any]] = yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return rows


@cache
def usb_chips() -> dict[str, UsbChip]:
    """What each identity, such as 2341:0043, and each vendor, such as 2341, stands for."""
    chips: dict[str, UsbChip] = {}
    for row in usb_rows():
        role = PortRole(row["role"])
        module = row.get("module", "" if role == PortRole.DFU else "cdc_acm")
        for title, identities in row.get("ids", {}).items():
            chip = UsbChip(title, role, module, row.get("board"))
            chips |= dict.fromkeys(identities, chip)
        chips |= {key: UsbChip(title, role, "") for title, key in row.get("vendors", {}).items()}
    return chips


def lookup_usb_id(vendor: int, product: int) -> UsbChip | None:
    """What a USB identity stands for; None if neither it nor its vendor is in the table."""
    chips = usb_chips()
    return chips.get(f"{vendor:04x}:{product:04x}") or chips.get(f"{vendor:04x}")
