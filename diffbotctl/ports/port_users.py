"""Which program has a port open, as far as procfs lets us see."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from diffbotctl.ports.sysfs import text


class PortUser(NamedTuple):
    """A running program; `process` 0 for one whose number nobody may see."""

    name: str
    process: int

    def __str__(self) -> str:
        return f"{self.name} (process {self.process})" if self.process else "another program"


UNSEEN = PortUser("", 0)


def programs(root: Path) -> Iterator[PortUser]:
    """Every running program."""
    with suppress(OSError):
        for folder in sorted((root / "proc").iterdir()):
            if folder.name.isdigit() and (name := text(folder / "comm")):
                yield PortUser(name, int(folder.name))


def holder(root: Path, device: str) -> PortUser | None:
    """Who has `device` open or locked, besides this process. None when nobody is seen to."""
    real = _real(root, device)
    number = _locker(root, real) or _opener(root, real)
    if number is None:
        return None
    return PortUser(text(root / "proc" / number / "comm"), int(number)) if number != "0" else UNSEEN


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
    for program in programs(root):
        if program.process == os.getpid():
            continue
        folder = root / "proc" / str(program.process) / "fd"
        with suppress(OSError):
            for file in folder.iterdir():
                with suppress(OSError):
                    if os.readlink(file) == device:
                        return str(program.process)
    return None
