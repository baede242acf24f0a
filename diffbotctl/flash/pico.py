"""Finding a Pico, in BOOTSEL or running, bringing it to BOOTSEL, and flashing it."""

from __future__ import annotations

import fcntl
import struct
import termios
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from diffbotctl.drivers.board_ports import (
    FlashError,
    OtherBoardError,
    SeveralBoardsError,
    board_of,
    candidates,
    picos,
    port_named,
    refuse_radio,
)
from diffbotctl.drivers.serial_port import open_port
from diffbotctl.flash.board_session import BoardSession, JobEvent, JobMessage
from diffbotctl.flash.boot_drive import (
    POLL_PERIOD_S,
    NoDriveError,
    check_drive,
    check_image,
    drives,
    flash_drive,
)
from diffbotctl.flash.flasher import send_settings
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.links.diffbot_settings import BoardSettings
from diffbotctl.links.link_protocol import USB_BAUD
from diffbotctl.links.uf2_format import INFO_FILE, RP2040_DRIVE
from diffbotctl.ports.sysfs import usb_devices
from diffbotctl.ports.usb_ids import BOOTSEL

TOUCH_BAUD = 1200  # a port opened at this rate and closed again asks for BOOTSEL
TOUCH_S = 0.1
DRIVE_S = 15.0  # longest time until the system has mounted the drive
PORT_S = 10.0  # and until the program has started and its port is there
LATER = "It gets the robot's settings at the next run"


class PicoTarget(NamedTuple):
    """A Pico: its boot drive, or the USB port of the program on it."""

    drive: Path | None
    port: str = ""

    @property
    def place(self) -> str:
        """The drive or the port, in words."""
        return f"drive {self.drive}" if self.drive else f"port {self.port}"


class NotMountedError(NoDriveError):
    """A Pico is in BOOTSEL, but its drive cannot be written to."""

    def __init__(self) -> None:
        FlashError.__init__(
            self,
            "drives",
            "a Pico in BOOTSEL is plugged in, but its drive is not mounted",
            f"open the drive {RP2040_DRIVE} in the file manager, or mount it: "
            f"udisksctl mount -b /dev/disk/by-label/{RP2040_DRIVE}",
        )


class NoTouchError(NoDriveError):
    """A Pico was asked to come to BOOTSEL, and no drive came."""

    def __init__(self, port: str) -> None:
        FlashError.__init__(
            self,
            f"port {port}",
            "the Pico was asked to come to BOOTSEL, but no drive of it was mounted",
            f"open the drive {RP2040_DRIVE} in the file manager and flash again; without such a "
            "drive hold BOOTSEL while you plug in the USB cable",
        )


def find_pico(port: str, root: Path = Path("/"), mounts: Path | None = None) -> PicoTarget:
    """The Pico that `port` names, a drive or a serial port; with `auto` the only one there is.

    Raises FlashError.
    """
    if port != "auto":
        return _named(port, root)
    found = [PicoTarget(drive) for drive in drives(mounts)]
    found += [PicoTarget(None, pico.name) for pico in picos(root)]
    if len(found) > 1:
        raise SeveralBoardsError([target.place.split(" ", 1)[1] for target in found])
    if found:
        return found[0]
    if any((device.vendor, device.product) == BOOTSEL for device in usb_devices(root)):
        raise NotMountedError
    for other in candidates(root=root):
        board = board_of(other)
        if board is not None:
            raise OtherBoardError(f"port {other.name}", board, BoardCode.RP2040)
    raise NoDriveError


def _named(port: str, root: Path) -> PicoTarget:
    if (Path(port) / INFO_FILE).is_file():
        return PicoTarget(Path(port))
    if Path(port).is_dir():
        raise NoDriveError(f"port {port}")
    refuse_radio(port)
    device = port_named(port, root)
    board = board_of(device) if device else None
    if board not in (None, BoardCode.RP2040):
        raise OtherBoardError(f"port {port}", board, BoardCode.RP2040)
    return PicoTarget(None, port)


def flash_pico(
    target: PicoTarget, file: Path, settings: BoardSettings | None
) -> Iterator[JobEvent]:
    """Bring the Pico to BOOTSEL if it runs, copy the program, and send it `settings`, if any.

    Raises RunError: a FlashError, or of opening the port.
    """
    check_image(file)
    drive = target.drive
    if drive is None:
        drive = bring_to_bootsel(target.port)
        yield JobMessage(f"the Pico on {target.port} was brought to BOOTSEL")
    check_drive(drive)
    before = {pico.device for pico in picos()}
    yield from flash_drive(drive, file)
    if settings is None:
        return
    device = _port_after(target.port, before)
    if device is None:
        yield JobMessage(LATER)
        return
    with BoardSession(device, USB_BAUD) as session:
        yield from send_settings(session, settings)


def bring_to_bootsel(device: str) -> Path:
    """The drive of the Pico that runs on this port. Raises RunError."""
    before = drives()
    port = open_port(device, TOUCH_BAUD)
    try:
        time.sleep(TOUCH_S)
        with suppress(
            OSError
        ):  # a pseudo-terminal has no such line; closing it has the same effect
            fcntl.ioctl(port.fd, termios.TIOCMBIC, struct.pack("I", termios.TIOCM_DTR))
    finally:
        port.close()
    beside = Path(device).parent / RP2040_DRIVE  # that of a virtual board
    deadline = time.monotonic() + DRIVE_S
    while time.monotonic() < deadline:
        new = [drive for drive in drives() if drive not in before]
        if (beside / INFO_FILE).is_file():
            new.append(beside)
        if new:
            return new[0]
        time.sleep(POLL_PERIOD_S)
    raise NoTouchError(device)


def _port_after(device: str, before: set[str]) -> str | None:
    """The port of the program that has just started: the former one, or a new one."""
    deadline = time.monotonic() + PORT_S
    while time.monotonic() < deadline:
        if device and Path(device).exists():
            return device
        new = [pico.device for pico in picos() if pico.device not in before]
        if new and not device:
            return new[0]
        time.sleep(POLL_PERIOD_S)
    return None
