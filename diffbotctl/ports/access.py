"""Access to ports: users and groups, the programs that have a port open, interfering services."""

from __future__ import annotations

import os
import pwd
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from diffbotctl.ports.sysfs import UsbDevice, read_text, real_path

READ_WRITE = 0o6


class SystemUser(NamedTuple):
    """A user. `groups` are in force in this session; `is_current` for the user of this process."""

    name: str
    user: int
    groups: frozenset[int]
    is_current: bool = False

    def may(self, path: Path, mode: int, owner: int, group: int) -> bool:
        """Whether this user may read and write a file with these permissions."""
        if self.is_current and os.access(path, os.R_OK | os.W_OK, effective_ids=True):
            return True  # includes access lists, which the mode does not show
        if self.user == 0:
            return True
        shift = 6 if self.user == owner else 3 if group in self.groups else 0
        return mode >> shift & READ_WRITE == READ_WRITE


def current_user() -> SystemUser:
    user = os.geteuid()
    try:
        name = pwd.getpwuid(user).pw_name
    except KeyError:
        name = f"user {user}"
    return SystemUser(name, user, frozenset({os.getegid(), *os.getgroups()}), is_current=True)


class Group(NamedTuple):
    """A group of the machine."""

    name: str
    number: int
    members: frozenset[str]


def system_groups(root: Path) -> dict[int, Group]:
    """The machine's groups by number, from /etc/group."""
    groups = {}
    for line in read_text(root / "etc/group").splitlines():
        fields = line.split(":")
        if len(fields) == 4 and fields[2].isdigit():
            members = frozenset(filter(None, fields[3].split(",")))
            groups[int(fields[2])] = Group(fields[0], int(fields[2]), members)
    return groups


class PortUser(NamedTuple):
    """A running program; `process` 0 for one whose number cannot be read."""

    name: str
    process: int

    def __str__(self) -> str:
        return f"{self.name} (process {self.process})" if self.process else "another program"


HIDDEN_USER = PortUser("", 0)


def running_programs(root: Path) -> Iterator[PortUser]:
    with suppress(OSError):
        for folder in sorted((root / "proc").iterdir()):
            if folder.name.isdigit() and (name := read_text(folder / "comm")):
                yield PortUser(name, int(folder.name))


def port_user(root: Path, device: str) -> PortUser | None:
    """The program that has `device` open or locked, other than this process. None if unknown."""
    device = real_path(root, device)
    process = _locking_process(root, device)
    if process is None:
        process = _opening_process(root, device)
    if not process:
        return None if process is None else HIDDEN_USER
    return PortUser(read_text(root / "proc" / str(process) / "comm"), process)


def _locking_process(root: Path, device: str) -> int | None:
    """The process that has locked it; 0 if its number is hidden.

    /proc/locks has a line `number: FLOCK ADVISORY WRITE pid device:inode ...` for each lock.
    """
    with suppress(OSError, ValueError, IndexError):
        status = (root / device[1:]).stat()
        identity = (os.major(status.st_dev), os.minor(status.st_dev), status.st_ino)
        for line in (root / "proc/locks").read_text().splitlines():
            fields = line.split()
            major, minor, inode = fields[5].split(":")
            if (int(major, 16), int(minor, 16), int(inode)) == identity:
                process = int(fields[4])
                return None if process == os.getpid() else max(process, 0)
    return None


def _opening_process(root: Path, device: str) -> int | None:
    """Another process that has it open. Those of other users are hidden."""
    for program in running_programs(root):
        if program.process == os.getpid():
            continue
        with suppress(OSError):
            for file in (root / "proc" / str(program.process) / "fd").iterdir():
                with suppress(OSError):
                    if os.readlink(file) == device:
                        return program.process
    return None


MODEM_MANAGER = "ModemManager"
UDEV_RULES = ("etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")
CONSOLE = re.compile(r"\bconsole=(tty(?:AMA|S|USB|ACM)\d+|serial\d+)")


def brltty_claims(root: Path, usb: UsbDevice) -> bool:
    """Whether brltty's udev rules claim this USB identity for a Braille display."""
    files: dict[str, Path] = {}
    for folder in UDEV_RULES:
        for file in (root / folder).glob("*brltty*.rules"):
            files.setdefault(file.name, file)  # the first folder's file hides those of the others
    lines = [line for file in files.values() for line in read_text(file).splitlines()]
    rule = f"{usb.vendor:x}/{usb.product:x}/"
    return any(rule in line.lower() for line in lines if not line.lstrip().startswith("#"))


def modem_manager_runs(root: Path) -> bool:
    return any(program.name == MODEM_MANAGER for program in running_programs(root))


def is_console(root: Path, device: str) -> bool:
    """Whether the kernel's console, and with it a login, is on this port."""
    names = CONSOLE.findall(read_text(root / "proc/cmdline"))
    return any(device == f"/dev/{(root / 'dev' / name).resolve().name}" for name in names)
