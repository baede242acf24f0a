"""USB identities of boards, of the serial chips of clones, and of devices that are no board."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class PortRole(StrEnum):
    """What a port or a USB device leads to."""

    BOARD = "board"  # one that our firmware runs on
    CHIP = "chip"  # a serial chip of a clone, or of any other device
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
    module: str = "cdc_acm"  # the kernel's driver that makes a serial port of it


ARDUINO, ARDUINO_ORG, RASPBERRY_PI, ATMEL, WCH = 0x2341, 0x2A03, 0x2E8A, 0x03EB, 0x1A86
MEGA_2560 = UsbChip("Arduino Mega 2560", PortRole.BOARD)
MEGA_ADK = UsbChip("Arduino Mega ADK", PortRole.OTHER_BOARD)
UNO = UsbChip("Arduino Uno", PortRole.BOARD)
LEONARDO = UsbChip("Arduino Leonardo", PortRole.OTHER_BOARD)
PICO = UsbChip("Raspberry Pi Pico", PortRole.BOARD)
PICO_PYTHON = UsbChip("Raspberry Pi Pico with MicroPython", PortRole.OTHER_BOARD)
BOOTSEL = (RASPBERRY_PI, 0x0003)  # a Pico that shows its boot drive; it has no serial port

USB_IDS: dict[tuple[int, int], UsbChip] = {
    (ARDUINO, 0x0010): MEGA_2560,
    (ARDUINO, 0x0042): MEGA_2560,
    (ARDUINO_ORG, 0x0010): MEGA_2560,
    (ARDUINO_ORG, 0x0042): MEGA_2560,
    (ARDUINO, 0x0210): MEGA_2560,
    (ARDUINO, 0x0242): MEGA_2560,
    (ARDUINO, 0x003F): MEGA_ADK,
    (ARDUINO, 0x0044): MEGA_ADK,
    (ARDUINO, 0x0001): UNO,
    (ARDUINO, 0x0043): UNO,
    (ARDUINO_ORG, 0x0043): UNO,
    (ARDUINO, 0x0036): LEONARDO,
    (ARDUINO, 0x8036): LEONARDO,
    (RASPBERRY_PI, 0x0005): PICO_PYTHON,
    (RASPBERRY_PI, 0x000A): PICO,
    (0x303A, 0x1001): UsbChip("ESP32", PortRole.OTHER_BOARD),
    (WCH, 0x7523): UsbChip("CH340", PortRole.CHIP, "ch341"),
    (WCH, 0x5523): UsbChip("CH341", PortRole.CHIP, "ch341"),
    (WCH, 0x55D4): UsbChip("CH9102", PortRole.CHIP),
    (0x0403, 0x6001): UsbChip("FT232R", PortRole.CHIP, "ftdi_sio"),
    (0x10C4, 0xEA60): UsbChip("CP2102", PortRole.CHIP, "cp210x"),
    # The Mega's own USB chip, an ATmega16U2, without its program.
    (ATMEL, 0x2FEF): UsbChip("ATmega16U2 in its DFU bootloader", PortRole.DFU, ""),
    (ATMEL, 0x2FF0): UsbChip("ATmega32U2 in its DFU bootloader", PortRole.DFU, ""),
}
# Vendors whose serial ports never lead to a board.
OTHER_VENDORS = {
    0x12D1: "a Huawei modem",
    0x19D2: "a ZTE modem",
    0x2C7C: "a Quectel modem",
    0x1199: "a Sierra modem",
    0x1546: "a u-blox satellite receiver",
    0x1915: "a Nordic radio",
}


def lookup_usb_id(vendor: int, product: int) -> UsbChip | None:
    """What a USB identity stands for; None if it is not in the tables."""
    if (vendor, product) not in USB_IDS and vendor in OTHER_VENDORS:
        return UsbChip(OTHER_VENDORS[vendor], PortRole.NO_BOARD, "")
    return USB_IDS.get((vendor, product))
