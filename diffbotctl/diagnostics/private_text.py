"""What is private on this machine, and its removal from texts and recordings.

Private are the names of users and computers, home folders, addresses of Bluetooth modules and in
networks, serial numbers, and what follows the host in a web address: it may be an access code.
Names that many machines share, such as `pi`, reveal nothing about a person and stay.
"""

from __future__ import annotations

import json
import os
import re
import socket
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from diffbotctl.ports.access import SystemUser
from diffbotctl.ports.diagnosis import PortSurvey
from diffbotctl.ports.sysfs import read_text

SHARED_NAMES = (
    *("admin", "debian", "guest", "home", "host", "kali", "linux", "local", "localhost", "nobody"),
    *("pi", "raspberry", "raspberrypi", "robot", "root", "student", "test", "ubuntu", "user"),
    *("arduino", "diffbotctl", "docker", "raspbian"),
)
PEOPLE_MIN_UID, PEOPLE_MAX_UID = 1000, 59999  # of persons on Debian; the others are services
SERIAL_MIN_LENGTH = 4  # shorter ones, such as "0", are those of chips without a number
NAME_MIN_LENGTH = 2  # a single letter is no name, and is a coordinate in each file
LONG_NAME_LENGTH = 4  # such bytes are no accident
PRINTABLE = re.compile(rb"[\x20-\x7e]{3,}")
NAME_VARIABLES = ("USER", "LOGNAME", "SUDO_USER", "HOSTNAME")
HOME_VARIABLES = ("HOME",)
PATTERNS = (  # for what is private on other machines too
    (re.compile(r"(?<![\w.])(?:/home|/Users)/[^/\s\"'\\:,]+|(?<![\w.])/root\b"), "~"),
    (re.compile(r"[\w.+-]+@[\w-]+(?:\.[\w-]+)*"), "(person)"),
    (re.compile(r"(?i)(?<![0-9a-f])[0-9a-f]{2}(?:[:_-][0-9a-f]{2}){5}(?![0-9a-f])"), "(address)"),
    # As an HC-05 writes it in reply to AT+ADDR?.
    (re.compile(r"(?i)(?<![\w:])[0-9a-f]{2,4}:[0-9a-f]{1,2}:[0-9a-f]{5,6}(?!\w)"), "(address)"),
    (re.compile(r"(?<![\w.])(?!127\.)\d{1,3}(?:\.\d{1,3}){3}(?![\w.])"), "(address)"),
    (re.compile(r"(?i)(?<![\w:])(?:[0-9a-f]{1,4}:){4,7}[0-9a-f]{1,4}(?!\w)"), "(address)"),
    (re.compile(r"(?<![\w:])fe80:[0-9a-f:]+"), "(address)"),
    (re.compile(r"(?<=/dev/serial/by-id/)[^\s\"']+|\busb-[\w.+-]+-(?:if|port)\d+"), "(serial)"),
    # As people write it in a comment. A port's name and a baud rate are shorter.
    (
        re.compile(
            r"(?i)(\bserial(?:[ _-]?(?:number|no\.?|nr\.?))?\s*[:=#]?\s*)(?=\w*\d\w*\d)[\w-]{8,}"
        ),
        r"\1(serial)",
    ),
    (re.compile(r"(?<=://)([^\s/\"'<>]+)[/#?](?!\(removed\))[^\s\"'<>)]+"), r"\1/(removed)"),
)


class PrivateText:
    """Removes what is private. `names` are those of people and computers."""

    def __init__(self, names: Iterable[str], homes: Iterable[str], serials: Iterable[str]) -> None:
        self.names = sorted({name for name in names if _is_private(name)}, key=len, reverse=True)
        self.literals = [
            *((home, "~") for home in _longest_first(homes) if len(home) > len("/root/")),
            *((serial, "(serial)") for serial in _longest_first(serials)),
        ]
        words = "|".join(map(re.escape, self.names))
        # Digits and underscores may surround a name, and an s may follow: anna2, of_anna, Annas.
        self.name = re.compile(rf"(?i)(?<![^\W\d_])(?:{words})s?(?![^\W\d_])") if words else None

    def without(self, text: str) -> str:
        """The text, with words in brackets in place of what is private."""
        for literal, replacement in self.literals:
            text = text.replace(literal, replacement)
        for pattern, replacement in PATTERNS:
            text = pattern.sub(replacement, text)
        return text if self.name is None else self.name.sub("(name)", text)

    def without_in_json(self, value: Any) -> Any:
        """A JSON value, the same in its texts, also in those that are JSON themselves."""
        match value:
            case str():
                return self._without_in_text(value)
            case list():
                return [self.without_in_json(item) for item in value]
            case dict():
                return {
                    self.without(name): self.without_in_json(item) for name, item in value.items()
                }
        return value

    def _without_in_text(self, text: str) -> str:
        if text[:1] in ("{", "["):  # escaped line ends would hide where a word begins
            try:
                value = json.loads(text)
            except (ValueError, RecursionError):
                return self.without(text)
            return json.dumps(self.without_in_json(value))
        return self.without(text)

    def is_in(self, data: bytes) -> bool:
        """Whether anything private is in bytes of an unknown format."""
        folded = data.lower()
        names = (name.lower().encode() for name in self.names if len(name) >= LONG_NAME_LENGTH)
        text = "\n".join(run.decode("ascii") for run in PRINTABLE.findall(data))
        return any(name in folded for name in names) or self.without(text) != text


def _longest_first(texts: Iterable[str]) -> list[str]:
    return sorted({text for text in texts if len(text) >= SERIAL_MIN_LENGTH}, key=len, reverse=True)


def _is_private(name: str) -> bool:
    return len(name) >= NAME_MIN_LENGTH and name.casefold() not in SHARED_NAMES


def private_text(root: Path, user: SystemUser, survey: PortSurvey) -> PrivateText:
    """What is private on the machine below `root`, and of this process."""
    names = [user.name, socket.gethostname(), read_text(root / "etc/hostname")]
    names += [os.environ.get(name, "") for name in NAME_VARIABLES]
    homes = [str(Path.home()), *(os.environ.get(name, "") for name in HOME_VARIABLES)]
    for account, full_name, home in _people(root):
        names += [account, full_name, *full_name.split()]
        homes.append(home)
    names += [name.partition(".")[0] for name in names]  # computers have a domain behind it
    devices = [report.port.usb for report in survey.reports if report.port.usb is not None]
    machine = read_text(root / "etc/machine-id").strip()
    return PrivateText(
        map(str.strip, names), homes, [machine, *(device.serial for device in devices)]
    )


def _people(root: Path) -> Iterator[tuple[str, str, str]]:
    """Account, full name and home folder of each person in /etc/passwd."""
    for line in read_text(root / "etc/passwd").splitlines():
        fields = line.split(":")
        if len(fields) != 7 or not fields[2].isdigit():
            continue
        if PEOPLE_MIN_UID <= int(fields[2]) <= PEOPLE_MAX_UID:
            yield fields[0], fields[4].partition(",")[0], fields[5]
