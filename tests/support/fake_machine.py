"""A folder that stands for `/` of a machine: the files from which its serial ports are known.

The layout is that of a Debian 12 laptop with a Mega plugged in: symbolic links from /sys/class to
/sys/devices, attributes one a file, links under /dev/serial. Devices are plain files, and belong to
whoever runs this; /etc/group calls that user's group what the case wants.
"""

import os
from pathlib import Path
from typing import Any

CH340 = (0x1A86, 0x7523)
MEGA = (0x2341, 0x0042)
FOLDERS = (
    "sys/class/tty",
    "sys/bus/usb/devices",
    "dev/serial/by-id",
    "dev/serial/by-path",
    "dev/pts",
    "proc",
    "etc",
    "run/udev/data",
)


class FakeMachine:
    """Build it up call by call; `root` is handed to what reads it."""

    def __init__(self, root: Path | str, group: str = "dialout", members: str = "") -> None:
        self.root = Path(root)
        for folder in FOLDERS:
            (self.root / folder).mkdir(parents=True)
        self.group(group, members)
        self.minors = 0
        self.processes = 300

    def group(self, name: str, members: str = "") -> None:
        """What the group that owns the ports is called, and who is in it."""
        self.write("etc/group", f"root:x:99999:\n{name}:x:{os.getgid()}:{members}\n")

    def write(self, path: str, content: str) -> None:
        """One file."""
        file = self.root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content)

    def link(self, path: str, target: str) -> None:
        """One symbolic link, its target as seen from inside."""
        file = self.root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.symlink_to(os.path.relpath(self.root / target.lstrip("/"), file.parent))

    def usb(
        self,
        place: str,
        identity: tuple[int, int],
        product: str = "",
        serial: str = "",
        driver: str = "",
    ) -> str:
        """A USB device with one interface."""
        folder = f"sys/devices/pci0000:00/usb1/{place}"
        self.write(f"{folder}/idVendor", f"{identity[0]:04x}\n")
        self.write(f"{folder}/idProduct", f"{identity[1]:04x}\n")
        if product:
            self.write(f"{folder}/product", product + "\n")
        if serial:
            self.write(f"{folder}/serial", serial + "\n")
        interface = f"{folder}/{place}:1.0"
        self.write(f"{interface}/bInterfaceNumber", "00\n")
        if driver:
            self.write(f"sys/bus/usb/drivers/{driver}/bind", "")
            self.link(f"{interface}/driver", f"sys/bus/usb/drivers/{driver}")
        self.link(f"sys/bus/usb/devices/{place}", folder)
        return interface

    def port(
        self,
        name: str,
        identity: tuple[int, int] | None = CH340,
        *,
        place: str = "1-1",
        product: str = "",
        serial: str = "",
        mode: int = 0o660,
        by_id: str = "",
        no_modem: bool = False,
        uart: str = "4",
    ) -> str:
        """A serial port; of a USB device unless `identity` is None. Returns its name."""
        self.minors += 1
        number = f"188:{self.minors}"
        device = f"sys/devices/platform/{name}"
        if identity is not None:
            driver = "cdc_acm" if "ACM" in name else "ch341"
            device = f"{self.usb(place, identity, product, serial, driver)}/{name}"
            self.link(f"dev/serial/by-path/pci-0000:00:14.0-usb-0:{place[2:]}:1.0", f"dev/{name}")
        self.write(f"{device}/tty/{name}/dev", number + "\n")
        if identity is not None:
            self.link(f"{device}/tty/{name}/device", device)
        elif name.startswith("tty"):
            self.write(f"{device}/tty/{name}/type", uart + "\n")
        self.link(f"sys/class/tty/{name}", f"{device}/tty/{name}")
        self.write(f"dev/{name}", "")
        (self.root / "dev" / name).chmod(mode)
        if by_id:
            self.link(f"dev/serial/by-id/{by_id}", f"dev/{name}")
        if no_modem:
            self.write(f"run/udev/data/c{number}", "E:ID_MM_DEVICE_IGNORE=1\n")
        return f"/dev/{name}"

    def rfcomm(
        self, name: str = "rfcomm0", address: str = "98:D3:31:FC:12:34", **options: Any
    ) -> str:
        """A port that the rfcomm command has bound to a Bluetooth module."""
        device = self.port(name, None, **options)
        self.write(f"sys/class/tty/{name}/address", address + "\n")
        return device

    def program(self, name: str, *devices: str) -> int:
        """A running program that has these open."""
        self.processes += 1
        self.write(f"proc/{self.processes}/comm", name + "\n")
        (self.root / f"proc/{self.processes}/fd").mkdir()
        for number, device in enumerate(devices, 3):
            (self.root / f"proc/{self.processes}/fd/{number}").symlink_to(device)
        return self.processes

    def lock(self, device: str, process: int) -> None:
        """Somebody has locked the device, as /proc/locks shows it."""
        about = (self.root / device[1:]).stat()
        number = f"{os.major(about.st_dev):02x}:{os.minor(about.st_dev):02x}:{about.st_ino}"
        self.write("proc/locks", f"1: FLOCK  ADVISORY  WRITE {process} {number} 0 EOF\n")
