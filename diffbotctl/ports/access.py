"""Who asks for a port: a user, the groups in force, and those that the next login will bring.

Which program has a port open, as far as procfs lets us see.

Programs of the system that take a board's port away: brltty and ModemManager; login consoles.
"""

from __future__ import annotations

import os
import pwd
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from diffbotctl.ports.sysfs import UsbDevice, read_text

READ_WRITE = 0o6


class SystemUser(NamedTuple):
    """A user. `groups` are in force in this session; `myself` for whoever runs this process."""

    name: str
    user: int
    groups: frozenset[int]
    myself: bool = False

    def may(self, path: Path, mode: int, owner: int, group: int) -> bool:
        """Whether this person may read and write a file of these rights."""
        if self.myself and os.access(path, os.R_OK | os.W_OK, effective_ids=True):
            return True  # access lists too, which the mode does not show
        if self.user == 0:
            return True
        if self.user == owner:
            return mode >> 6 & READ_WRITE == READ_WRITE
        if group in self.groups:
            return mode >> 3 & READ_WRITE == READ_WRITE
        return mode & READ_WRITE == READ_WRITE


def current_user() -> SystemUser:
    """Whoever runs this process."""
    user = os.geteuid()
    try:
        name = pwd.getpwuid(user).pw_name
    except KeyError:
        name = f"user {user}"
    return SystemUser(name, user, frozenset({os.getegid(), *os.getgroups()}), myself=True)


class Group(NamedTuple):
    """A group of the machine's list."""

    name: str
    number: int
    members: frozenset[str]


def system_groups(root: Path) -> dict[int, Group]:
    """The machine's groups by number, from /etc/group."""
    found = {}
    for line in read_text(root / "etc/group").splitlines():
        words = line.split(":")
        if len(words) == 4 and words[2].isdigit():
            members = frozenset(filter(None, words[3].split(",")))
            found[int(words[2])] = Group(words[0], int(words[2]), members)
    return found


class PortUser(NamedTuple):
    """A running program; `process` 0 for one whose number nobody may see."""

    name: str
    process: int

    def __str__(self) -> str:
        return f"{self.name} (process {self.process})" if self.process else "another program"


HIDDEN_USER = PortUser("", 0)


def running_programs(root: Path) -> Iterator[PortUser]:
    """Every running program."""
    with suppress(OSError):
        for folder in sorted((root / "proc").iterdir()):
            if folder.name.isdigit() and (name := read_text(folder / "comm")):
                yield PortUser(name, int(folder.name))


def port_user(root: Path, device: str) -> PortUser | None:
    """Who has `device` open or locked, besides this process. None when nobody is seen to."""
    real = _real(root, device)
    number = _locker(root, real) or _opener(root, real)
    if number is None:
        return None
    return (
        PortUser(read_text(root / "proc" / number / "comm"), int(number))
        if number != "0"
        else HIDDEN_USER
    )


def _real(root: Path, device: str) -> str:
    """The device that a name leads to, as seen from inside the root."""
    path = root / device[1:]
    with suppress(OSError):
        return "/" + str(path.resolve().relative_to(root.resolve()))
    return device


def _locker(root: Path, device: str) -> str | None:
    """Who has locked it: `number: FLOCK ADVISORY WRITE pid device:inode ...` a line."""
    with suppress(OSError, ValueError, IndexError):
        about = (root / device[1:]).stat()
        wanted = (os.major(about.st_dev), os.minor(about.st_dev), about.st_ino)
        for line in (root / "proc/locks").read_text().splitlines():
            words = line.split()
            major, minor, inode = words[5].split(":")
            if (int(major, 16), int(minor, 16), int(inode)) == wanted:
                own = words[4] == str(os.getpid())
                return None if own else words[4] if int(words[4]) > 0 else "0"
    return None


def _opener(root: Path, device: str) -> str | None:
    """Who else has it open. Another user's programs do not show theirs."""
    for program in running_programs(root):
        if program.process == os.getpid():
            continue
        folder = root / "proc" / str(program.process) / "fd"
        with suppress(OSError):
            for file in folder.iterdir():
                with suppress(OSError):
                    if os.readlink(file) == device:
                        return str(program.process)
    return None


MODEM_MANAGER = "ModemManager"
RULES = ("etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")
CONSOLE = re.compile(r"\bconsole=(tty(?:AMA|S|USB|ACM)\d+|serial\d+)")


def brltty_claims(root: Path, usb: UsbDevice) -> bool:
    """Whether brltty's udev rules claim this USB identity for a Braille display."""
    wanted = f"{usb.vendor:x}/{usb.product:x}/"
    return any(
        wanted in line.lower() for line in _brltty_rules(root) if not line.lstrip().startswith("#")
    )


def _brltty_rules(root: Path) -> list[str]:
    lines: list[str] = []
    seen = set()
    for folder in RULES:
        for file in sorted((root / folder).glob("*brltty*.rules")):
            if file.name not in seen:  # the first folder's file hides those of the others
                seen.add(file.name)
                lines += read_text(file).splitlines()
    return lines


def modem_manager_runs(root: Path) -> bool:
    """Whether ModemManager runs."""
    return any(program.name == MODEM_MANAGER for program in running_programs(root))


def is_console(root: Path, device: str) -> bool:
    """Whether the kernel's console, and with it a login, is on this port."""
    for name in CONSOLE.findall(read_text(root / "proc/cmdline")):
        real = (root / "dev" / name).resolve().name
        if device == f"/dev/{real}":
            return True
    return False
