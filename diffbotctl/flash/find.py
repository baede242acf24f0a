"""Which port leads to a board."""

from __future__ import annotations

import os
import re
from typing import NamedTuple

from diffbotctl.flash.trouble import NoBoardError, RadioPortError, SeveralBoardsError

# Vendor and product of a Mega 2560: genuine ones, and the USB chips that clones carry.
GENUINE = {(vendor, product) for vendor in (0x2341, 0x2A03) for product in (0x0010, 0x0042)}
GENUINE |= {(0x2341, 0x0210), (0x2341, 0x0242)}
CLONES = {(0x1A86, 0x7523), (0x1A86, 0x5523), (0x0403, 0x6001), (0x10C4, 0xEA60)}


USB = re.compile(r"tty(ACM|USB)\d+\Z")
RADIO = re.compile(r"rfcomm\d+\Z")


class Candidate(NamedTuple):
    """A port that may lead to a board."""

    device: str
    title: str
    likely: bool  # a genuine Mega; clones share their USB chip with other things


def candidates() -> list[Candidate]:
    """Ports that may lead to a Mega 2560, genuine boards first."""
    from serial.tools import list_ports

    found = []
    for port in list_ports.comports():
        usb = (port.vid, port.pid)
        if usb in GENUINE or usb in CLONES:
            title = port.product or port.description or "USB serial"
            found.append(Candidate(port.device, title, usb in GENUINE))
    return sorted(found, key=lambda each: (not each.likely, each.device))


def choose(found: list[Candidate]) -> Candidate:
    """The one board. Raises NoBoardError, SeveralBoardsError."""
    likely = [each for each in found if each.likely] or found
    if not likely:
        raise NoBoardError
    if len(likely) > 1:
        raise SeveralBoardsError([each.device for each in likely])
    return likely[0]


def is_usb(device: str) -> bool:
    """Whether the port leads over USB: to UART0 at 115200 baud, and opening it resets the board."""
    return any(USB.search(name) for name in (device, os.path.realpath(device)))


def refuse_radio(device: str) -> None:
    """Raises RadioPortError for a port that leads over Bluetooth."""
    if any(RADIO.search(name) for name in (device, os.path.realpath(device))):
        raise RadioPortError(device)
