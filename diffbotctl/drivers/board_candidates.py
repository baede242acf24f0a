"""Which port leads to a board."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from diffbotctl.bluetooth.bluez import PORT_PREFIX
from diffbotctl.drivers.board_errors import NoBoardError, RadioPortError, SeveralBoardsError
from diffbotctl.ports.usb_ids import CHIP, MEGA, USB_IDS

GENUINE = {identity for identity, kind in USB_IDS.items() if kind.role == MEGA}
CLONES = {identity for identity, kind in USB_IDS.items() if kind.role == CHIP}

if TYPE_CHECKING:
    from serial.tools.list_ports_common import ListPortInfo

USB = re.compile(r"tty(ACM|USB)\d+\Z")
RADIO = re.compile(r"rfcomm\d+\Z")


STABLE_NAMES = Path("/dev/serial/by-id")


class Candidate(NamedTuple):
    """A port that may lead to a board."""

    device: str
    title: str
    likely: bool  # a genuine Mega; clones share their USB chip with other things
    stable: str = ""  # a name that stays the same when other devices come and go


def candidates(radio: bool = False) -> list[Candidate]:
    """This machine's ports that may lead to a Mega 2560; with `radio`, bound Bluetooth ports too.

    Those that may be boards come first.
    """
    # Imported late: pyserial is heavy, and only a list of all ports needs it.
    from serial.tools import list_ports

    return sort(list_ports.comports(), radio, stable_names(STABLE_NAMES))


def sort(
    ports: Iterable[ListPortInfo], radio: bool = False, stable: dict[str, str] | None = None
) -> list[Candidate]:
    """The candidates among `ports`; `stable` has the stable name of a device."""
    found = []
    for port in ports:
        usb, name = (port.vid, port.pid), (stable or {}).get(port.device, "")
        if usb in GENUINE or usb in CLONES:
            title = port.product or port.description or "USB serial"
            found.append(Candidate(port.device, title, usb in GENUINE, name))
        elif radio and RADIO.search(port.device):
            found.append(Candidate(port.device, "Bluetooth", True))
    return sorted(found, key=lambda each: (not each.likely, each.device))


def stable_names(folder: Path) -> dict[str, str]:
    """Stable name of each device; udev makes such links for USB ports."""
    names = {}
    with suppress(OSError):
        for link in sorted(folder.iterdir()):
            names[os.path.realpath(link)] = str(link)
    return names


def choose(found: list[Candidate]) -> Candidate:
    """The one board. Raises NoBoardError, SeveralBoardsError."""
    likely = [each for each in found if each.likely] or found
    if not likely:
        raise NoBoardError
    if len(likely) > 1:
        raise SeveralBoardsError([each.stable or each.device for each in likely])
    return likely[0]


def is_usb(device: str) -> bool:
    """Whether the port leads over USB: to UART0 at 115200 baud, and opening it resets the board."""
    return any(USB.search(name) for name in (device, os.path.realpath(device)))


def refuse_radio(device: str) -> None:
    """Raises RadioPortError for a port that leads over Bluetooth."""
    bound = any(RADIO.search(name) for name in (device, os.path.realpath(device)))
    if bound or device.startswith(PORT_PREFIX):
        raise RadioPortError(device)
