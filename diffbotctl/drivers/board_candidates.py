"""Which port leads to a board."""

from __future__ import annotations

import os
import re
from pathlib import Path

from diffbotctl.bluetooth.bluez import PORT_PREFIX
from diffbotctl.drivers.board_errors import NoBoardError, RadioPortError, SeveralBoardsError
from diffbotctl.ports.sysfs import SerialPort, serial_ports
from diffbotctl.ports.usb_ids import PortRole

USB = re.compile(r"tty(ACM|USB)\d+\Z")
RADIO = re.compile(r"rfcomm\d+\Z")
# A genuine Mega, or a bound module; clones share their USB chip with other things.
LIKELY_ROLES = (PortRole.MEGA, PortRole.BLUETOOTH)


def candidates(radio: bool = False, root: Path = Path("/")) -> list[SerialPort]:
    """The ports below `root` that may lead to a Mega 2560; with `radio`, bound Bluetooth ports too.

    The likely ones come first.
    """
    roles = {PortRole.MEGA, PortRole.CHIP} | ({PortRole.BLUETOOTH} if radio else set())
    ports = [port for port in serial_ports(root) if port.role in roles]
    return sorted(ports, key=lambda port: (port.role not in LIKELY_ROLES, port.device))


def choose(ports: list[SerialPort]) -> SerialPort:
    """The one board. Raises NoBoardError, SeveralBoardsError."""
    likely = [port for port in ports if port.role in LIKELY_ROLES] or ports
    if not likely:
        raise NoBoardError
    if len(likely) > 1:
        raise SeveralBoardsError([port.name for port in likely])
    return likely[0]


def is_usb(device: str) -> bool:
    """Whether the port leads over USB: to UART0 at 115200 baud, and opening it resets the board."""
    return any(USB.search(name) for name in (device, os.path.realpath(device)))


def refuse_radio(device: str) -> None:
    """Raises RadioPortError for a port that leads over Bluetooth."""
    bound = any(RADIO.search(name) for name in (device, os.path.realpath(device)))
    if bound or device.startswith(PORT_PREFIX):
        raise RadioPortError(device)
