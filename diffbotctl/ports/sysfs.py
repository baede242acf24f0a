"""The serial ports and USB devices that the kernel lists, read below a folder that stands for `/`.

This is the only enumeration of ports. Everything is read from files (sysfs, devtmpfs, procfs,
udev's database), so a folder with the same files stands for another machine.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from diffbotctl.ports.usb_ids import PortRole, UsbChip, lookup_usb_id

ONBOARD = re.compile(r"tty(AMA|S|THS|mxc|SAC|TCU)\d+\Z")
PLUGGED = re.compile(r"(tty(USB|ACM)|rfcomm)\d+\Z")
UART_TYPE_NONE = "0"  # `type` of a ttyS without hardware


class UsbDevice(NamedTuple):
    """One USB device."""

    vendor: int
    product: int
    title: str  # the product string of the device; may be empty
    serial: str
    place: str  # bus and sockets, such as 1-1.2
    drivers: tuple[str, ...]  # of its interfaces; "" for one without driver

    @property
    def chip(self) -> UsbChip | None:
        return lookup_usb_id(self.vendor, self.product)

    @property
    def identity(self) -> str:
        """Vendor and product as `lsusb` writes them."""
        return f"{self.vendor:04x}:{self.product:04x}"


class SerialPort(NamedTuple):
    """One serial port."""

    device: str
    usb: UsbDevice | None = None
    address: str = ""  # of the Bluetooth module that rfcomm has bound
    mode: int = 0
    owner: int = 0
    group: int = 0
    stable: str = ""  # a name under /dev/serial/by-id; empty if udev has made none
    place: str = ""  # a name under /dev/serial/by-path
    no_modem: bool = False  # udev makes ModemManager ignore it

    @property
    def role(self) -> PortRole:
        """The role of its USB identity, or the kind of port."""
        if self.usb is not None:
            return self.usb.chip.role if self.usb.chip else PortRole.UNKNOWN
        is_radio = self.address or "rfcomm" in self.device
        return PortRole.BLUETOOTH if is_radio else PortRole.ONBOARD

    @property
    def name(self) -> str:
        return self.stable or self.device


def serial_ports(root: Path) -> list[SerialPort]:
    """Every serial port: USB, Bluetooth, and those of the machine's own hardware.

    In the order of their names and numbers: ttyUSB2 before ttyUSB10.
    """
    stable, place = _links(root, "dev/serial/by-id"), _links(root, "dev/serial/by-path")
    ports = []
    for folder in _entries(root / "sys/class/tty"):
        device = f"/dev/{folder.name}"
        if not _is_serial(folder):
            continue
        with suppress(OSError):
            status = (root / device[1:]).stat()
            port = SerialPort(
                device,
                _usb_parent(folder / "device"),
                read_text(folder / "address"),
                status.st_mode & 0o777,
                status.st_uid,
                status.st_gid,
                stable.get(device, ""),
                place.get(device, ""),
                _ignored_by_modem_manager(root, folder),
            )
            ports.append(port)
    return sorted(ports, key=_device_order)


def _device_order(port: SerialPort) -> tuple[str, int]:
    letters = port.device.rstrip("0123456789")
    return letters, int(port.device[len(letters) :] or 0)


def _is_serial(folder: Path) -> bool:
    if PLUGGED.match(folder.name):
        return True
    has_hardware = read_text(folder / "type") not in ("", UART_TYPE_NONE)
    return bool(ONBOARD.match(folder.name)) and has_hardware


def usb_devices(root: Path) -> list[UsbDevice]:
    """Every USB device, with or without a serial port."""
    folders = _entries(root / "sys/bus/usb/devices")
    return [_usb_device(folder.resolve()) for folder in folders if _is_usb_device(folder)]


def _is_usb_device(folder: Path) -> bool:
    return (folder / "idVendor").exists()


def _usb_parent(device: Path) -> UsbDevice | None:
    if not device.exists():
        return None
    folders = (device.resolve(), *device.resolve().parents)
    return next((_usb_device(folder) for folder in folders if _is_usb_device(folder)), None)


def _usb_device(folder: Path) -> UsbDevice:
    interfaces = [entry for entry in _entries(folder) if entry.name.startswith(f"{folder.name}:")]
    links = [interface / "driver" for interface in interfaces]
    return UsbDevice(
        int(read_text(folder / "idVendor") or "0", 16),
        int(read_text(folder / "idProduct") or "0", 16),
        read_text(folder / "product"),
        read_text(folder / "serial"),
        folder.name,
        tuple(os.path.basename(os.readlink(link)) if link.is_symlink() else "" for link in links),
    )


def _ignored_by_modem_manager(root: Path, folder: Path) -> bool:
    """Whether udev's database has ID_MM_DEVICE_IGNORE for the port."""
    entry = read_text(root / "run/udev/data" / f"c{read_text(folder / 'dev')}")
    return "E:ID_MM_DEVICE_IGNORE=1" in entry.split("\n")


def _links(root: Path, folder: str) -> dict[str, str]:
    """Device -> the full name of the first link to it."""
    links: dict[str, str] = {}
    for link in _entries(root / folder):
        with suppress(OSError):
            target = os.path.normpath(os.path.join("/", folder, os.readlink(link)))
            links.setdefault(target, f"/{folder}/{link.name}")
    return links


def _entries(folder: Path) -> list[Path]:
    """The entries of a folder, by name; none if it does not exist."""
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def read_text(path: Path) -> str:
    """The content of a small file, stripped; "" when it cannot be read."""
    try:
        return path.read_text("utf-8", "replace").strip()
    except OSError:
        return ""


def real_path(root: Path, name: str) -> str:
    """The path that a name leads to, as seen from inside the root."""
    with suppress(OSError, RuntimeError, ValueError):  # RuntimeError: a ring of links
        return f"/{(root / name.lstrip('/')).resolve().relative_to(root.resolve())}"
    return name
