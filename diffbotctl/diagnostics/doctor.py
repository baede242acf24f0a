"""A look over the whole machine: versions, rights, ports, Bluetooth, optional packages."""

from __future__ import annotations

import platform
import socket
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from diffbotctl import __version__
from diffbotctl.bluetooth.errors import AdapterStatus, adapter_status
from diffbotctl.errors import Problem
from diffbotctl.ports.access import SystemUser, system_groups
from diffbotctl.ports.diagnosis import PortSurvey
from diffbotctl.ports.usb_ids import PortRole

OK, NOTE, BAD = "ok", "--", "!!"
OLDEST = (3, 11)
NEEDED = ("click", "cobs", "mcap", "numpy", "pyserial", "pyyaml", "rich")
SERIAL_GROUPS = ("dialout", "uucp", "plugdev")


class Package(NamedTuple):
    """An optional package of the system: the file that shows it, and what it is for."""

    name: str
    file: str
    purpose: str


PACKAGES = (
    Package("avrdude", "bin/avrdude", "`flash --programmer avrdude`; diffbotctl flashes without"),
    Package("gcc-avr", "bin/avr-gcc", "building the firmware; a built one is shipped"),
    Package("libsimavr-dev", "include/simavr/sim_avr.h", "`emulate` and `run --port emulated`"),
    Package("gcc", "bin/gcc", "`emulate` and `run --port emulated`"),
)


class DoctorFinding(NamedTuple):
    """One line: how it stands, what it is about, what was found, what to do."""

    verdict: str
    topic: str
    words: str
    fix: str = ""


def doctor_findings(root: Path, person: SystemUser, seen: PortSurvey) -> Iterator[DoctorFinding]:
    """Everything that was looked at, good or bad. Opens no port."""
    yield from _versions()
    yield _groups(root, person)
    yield from _ports(seen)
    yield from check_bluetooth(adapter_status(root))
    yield from _packages(root)


def _versions() -> Iterator[DoctorFinding]:
    good = sys.version_info[:2] >= OLDEST
    fix = "" if good else "Python 3.11 or newer"
    words = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    yield DoctorFinding(OK if good else BAD, "Python", words, fix)
    yield DoctorFinding(OK, "diffbotctl", __version__)
    missing = [name for name in NEEDED if _version(name) is None]
    if missing:
        fix = f"python3 -m pip install {' '.join(missing)}"
        yield DoctorFinding(BAD, "packages", f"not installed: {', '.join(missing)}", fix)
    else:
        yield DoctorFinding(
            OK, "packages", ", ".join(f"{name} {_version(name)}" for name in NEEDED)
        )


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _groups(root: Path, person: SystemUser) -> DoctorFinding:
    serial = [group for group in system_groups(root).values() if group.name in SERIAL_GROUPS]
    mine = [group.name for group in serial if group.number in person.groups]
    if person.user == 0:
        words = "root may do anything; as an ordinary user diffbotctl needs no root"
        return DoctorFinding(OK, "groups", words)
    if mine:
        return DoctorFinding(OK, "groups", f"{person.name} is in {', '.join(mine)}")
    if any(person.name in group.members for group in serial):
        return DoctorFinding(
            BAD, "groups", "joined, but not in force in this session", "log in anew"
        )
    name = next((group.name for group in serial), "dialout")
    fix = f"sudo usermod -aG {name} {person.name}, then log out and in again"
    return DoctorFinding(
        NOTE, "groups", f"{person.name} is in no group that owns serial ports", fix
    )


def _ports(seen: PortSurvey) -> Iterator[DoctorFinding]:
    for report in seen.reports:
        words = f"{report.port.device}  {report.title}"
        wanted = report.port.usb is not None or report.port.role == PortRole.BLUETOOTH
        yield DoctorFinding(OK if report.usable else BAD if wanted else NOTE, "port", words)
        for problem in report.problems:
            yield _of(problem, wanted)
    for problem in seen.problems:
        yield _of(problem, True)


def _of(problem: Problem, wanted: bool) -> DoctorFinding:
    """A problem of a port; only a port that a board may hang on can be in the way."""
    verdict = BAD if wanted and problem.severity != "warning" else NOTE
    return DoctorFinding(verdict, problem.code, f"{problem.place}: {problem.cause}", problem.fix)


def check_bluetooth(found: AdapterStatus) -> Iterator[DoctorFinding]:
    """Whether a Bluetooth module could be reached; of interest to those who have one."""
    topic = "Bluetooth"
    if not hasattr(socket, "AF_BLUETOOTH"):
        yield DoctorFinding(
            NOTE,
            topic,
            "this Python was built without Bluetooth sockets",
            "use the system's own: /usr/bin/python3 -m venv ...",
        )
    if _version("jeepney") is None:
        yield DoctorFinding(
            NOTE,
            topic,
            "the package jeepney is missing, so `bluetooth scan` and `pair` cannot ask the system",
            "pip install 'diffbotctl[bluetooth]'",
        )
    trouble = found.problem
    if trouble is None:
        yield DoctorFinding(OK, topic, f"{', '.join(found.names)} is there, the service runs")
    else:
        yield DoctorFinding(NOTE, topic, trouble.cause, trouble.fix)


def _packages(root: Path) -> Iterator[DoctorFinding]:
    for package in PACKAGES:
        folders = ("usr", "usr/local", "")
        if any((root / folder / package.file).exists() for folder in folders):
            yield DoctorFinding(OK, package.name, "installed")
        else:
            yield DoctorFinding(
                NOTE,
                package.name,
                f"not installed; only for {package.purpose}",
                f"sudo apt-get install {package.name}",
            )
