"""Who asks for a port: a user, the groups in force, and those that the next login will bring."""

from __future__ import annotations

import os
import pwd
from pathlib import Path
from typing import NamedTuple

from diffbotctl.ports.sysfs import text

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


def groups(root: Path) -> dict[int, Group]:
    """The machine's groups by number, from /etc/group."""
    found = {}
    for line in text(root / "etc/group").splitlines():
        words = line.split(":")
        if len(words) == 4 and words[2].isdigit():
            members = frozenset(filter(None, words[3].split(",")))
            found[int(words[2])] = Group(words[0], int(words[2]), members)
    return found
