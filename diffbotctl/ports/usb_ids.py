"""USB identities of boards, of the serial chips that clones carry, and of what is no board."""

from __future__ import annotations

from typing import NamedTuple


class UsbChip(NamedTuple):
    """What a USB identity stands for."""

    title: str
    role: str  # mega, chip (of a clone, or of anything else), other_board, dfu, no_board
    module: str  # the kernel's driver that makes a serial port of it


ARDUINO, ARDUINO_ORG = 0x2341, 0x2A03
MEGA, OTHER_BOARD, CHIP, DFU, NO_BOARD = "mega", "other_board", "chip", "dfu", "no_board"

USB_IDS: dict[tuple[int, int], UsbChip] = {
    (vendor, product): UsbChip("Arduino Mega 2560", MEGA, "cdc_acm")
    for vendor in (ARDUINO, ARDUINO_ORG)
    for product in (0x0010, 0x0042)
}
USB_IDS |= {
    (ARDUINO, 0x0210): UsbChip("Arduino Mega 2560", MEGA, "cdc_acm"),
    (ARDUINO, 0x0242): UsbChip("Arduino Mega 2560", MEGA, "cdc_acm"),
    (ARDUINO, 0x003F): UsbChip("Arduino Mega ADK", OTHER_BOARD, "cdc_acm"),
    (ARDUINO, 0x0044): UsbChip("Arduino Mega ADK", OTHER_BOARD, "cdc_acm"),
    (ARDUINO, 0x0001): UsbChip("Arduino Uno", OTHER_BOARD, "cdc_acm"),
    (ARDUINO, 0x0043): UsbChip("Arduino Uno", OTHER_BOARD, "cdc_acm"),
    (ARDUINO_ORG, 0x0043): UsbChip("Arduino Uno", OTHER_BOARD, "cdc_acm"),
    (ARDUINO, 0x0036): UsbChip("Arduino Leonardo", OTHER_BOARD, "cdc_acm"),
    (ARDUINO, 0x8036): UsbChip("Arduino Leonardo", OTHER_BOARD, "cdc_acm"),
    (0x2E8A, 0x0005): UsbChip("Raspberry Pi Pico", OTHER_BOARD, "cdc_acm"),
    (0x2E8A, 0x000A): UsbChip("Raspberry Pi Pico", OTHER_BOARD, "cdc_acm"),
    (0x303A, 0x1001): UsbChip("ESP32", OTHER_BOARD, "cdc_acm"),
    (0x1A86, 0x7523): UsbChip("CH340", CHIP, "ch341"),
    (0x1A86, 0x5523): UsbChip("CH341", CHIP, "ch341"),
    (0x1A86, 0x55D4): UsbChip("CH9102", CHIP, "cdc_acm"),
    (0x0403, 0x6001): UsbChip("FT232R", CHIP, "ftdi_sio"),
    (0x10C4, 0xEA60): UsbChip("CP2102", CHIP, "cp210x"),
    # The Mega's own USB chip, an ATmega16U2, waiting for a program of its own.
    (0x03EB, 0x2FEF): UsbChip("ATmega16U2 in its DFU bootloader", DFU, ""),
    (0x03EB, 0x2FF0): UsbChip("ATmega32U2 in its DFU bootloader", DFU, ""),
}
# Makers whose serial ports lead to something else for certain.
OTHER_MAKERS = {
    0x12D1: "a Huawei modem",
    0x19D2: "a ZTE modem",
    0x2C7C: "a Quectel modem",
    0x1199: "a Sierra modem",
    0x1546: "a u-blox satellite receiver",
    0x1915: "a Nordic radio",
}


def lookup_usb_id(vendor: int, product: int) -> UsbChip | None:
    """What is known of a USB identity; None for one that may be anything."""
    known = USB_IDS.get((vendor, product))
    if known is None and vendor in OTHER_MAKERS:
        return UsbChip(OTHER_MAKERS[vendor], NO_BOARD, "")
    return known
