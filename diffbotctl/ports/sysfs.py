"""What the kernel tells of its serial ports, read below a folder that stands for `/`.

Everything comes from files (sysfs, devtmpfs, procfs, udev's database), so a folder with the same
files is a machine to this module: nothing else is asked.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from diffbotctl.ports.usb_ids import UsbChip, lookup_usb_id

ONBOARD = re.compile(r"tty(AMA|S|THS|mxc|SAC|TCU)\d+\Z")
PLUGGED = re.compile(r"(tty(USB|ACM)|rfcomm)\d+\Z")
HARDWARE_NONE = "0"  # `type` of a ttyS whose chip the kernel did not find


class UsbDevice(NamedTuple):
    """One USB device."""

    vendor: int
    product: int
    title: str  # as the device calls itself, "" when it does not
    serial: str
    place: str  # bus and sockets, such as 1-1.2
    drivers: tuple[str, ...]  # of its interfaces, "" for one that nobody drives

    @property
    def kind(self) -> UsbChip | None:
        """What is known of its identity."""
        return lookup_usb_id(self.vendor, self.product)

    @property
    def identity(self) -> str:
        """Vendor and product as `lsusb` writes them."""
        return f"{self.vendor:04x}:{self.product:04x}"


class SerialPort(NamedTuple):
    """One serial port that is there."""

    device: str
    usb: UsbDevice | None
    address: str  # of the Bluetooth module that rfcomm has bound, else ""
    mode: int
    owner: int
    group: int
    stable: str  # a name under /dev/serial/by-id, "" where udev made none
    place: str  # a name under /dev/serial/by-path
    no_modem: bool  # udev tells ModemManager to leave it alone

    @property
    def number(self) -> tuple[str, int]:
        """For sorting: ttyUSB2 before ttyUSB10."""
        found = re.match(r"(.*?)(\d*)\Z", self.device)
        assert found is not None
        return found[1], int(found[2] or 0)


def serial_ports(root: Path) -> list[SerialPort]:
    """Every serial port worth naming: USB, Bluetooth, and those soldered to the machine."""
    stable = _links(root, "dev/serial/by-id")
    place = _links(root, "dev/serial/by-path")
    found = []
    for folder in _folders(root / "sys/class/tty"):
        if not _is_serial(folder):
            continue
        device = f"/dev/{folder.name}"
        with suppress(OSError):
            found.append(_port(root, folder, device, stable.get(device), place.get(device)))
    return sorted(found, key=lambda port: port.number)


def _is_serial(folder: Path) -> bool:
    if PLUGGED.match(folder.name):
        return True
    return bool(ONBOARD.match(folder.name)) and read_text(folder / "type") not in (
        "",
        HARDWARE_NONE,
    )


def _port(
    root: Path, folder: Path, device: str, stable: str | None, place: str | None
) -> SerialPort:
    about = (root / device[1:]).stat()
    return SerialPort(
        device,
        _usb_above(folder / "device"),
        read_text(folder / "address"),
        about.st_mode & 0o777,
        about.st_uid,
        about.st_gid,
        stable or "",
        place or "",
        _no_modem(root, folder),
    )


def usb_devices(root: Path) -> list[UsbDevice]:
    """Every USB device, with or without a serial port."""
    folders = _folders(root / "sys/bus/usb/devices")
    return [_usb(folder.resolve()) for folder in folders if (folder / "idVendor").exists()]


def _usb_above(device: Path) -> UsbDevice | None:
    """The USB device that a port's folder lies in."""
    if not device.exists():
        return None
    here = device.resolve()
    for folder in (here, *here.parents):
        if (folder / "idVendor").exists():
            return _usb(folder)
    return None


def _usb(folder: Path) -> UsbDevice:
    interfaces = [each for each in _folders(folder) if each.name.startswith(f"{folder.name}:")]
    drivers = tuple(
        os.path.basename(os.readlink(each / "driver")) if (each / "driver").is_symlink() else ""
        for each in interfaces
    )
    return UsbDevice(
        int(read_text(folder / "idVendor") or "0", 16),
        int(read_text(folder / "idProduct") or "0", 16),
        read_text(folder / "product"),
        read_text(folder / "serial"),
        folder.name,
        drivers,
    )


def _no_modem(root: Path, folder: Path) -> bool:
    """Whether udev's database has ID_MM_DEVICE_IGNORE for the port."""
    entry = read_text(root / "run/udev/data" / f"c{read_text(folder / 'dev')}")
    return "E:ID_MM_DEVICE_IGNORE=1" in entry.split("\n")


def _links(root: Path, folder: str) -> dict[str, str]:
    """Device -> the full name of the link to it."""
    found: dict[str, str] = {}
    for link in _folders(root / folder):
        with suppress(OSError):
            target = os.path.normpath(os.path.join("/", folder, os.readlink(link)))
            found.setdefault(target, f"/{folder}/{link.name}")
    return found


def _folders(path: Path) -> Iterator[Path]:
    """What is in a folder, by name; nothing where there is none."""
    with suppress(OSError):
        yield from sorted(path.iterdir())


def read_text(path: Path) -> str:
    """A small file's content without its last line break; "" when it cannot be read."""
    try:
        return path.read_text("utf-8", "replace").strip()
    except OSError:
        return ""
