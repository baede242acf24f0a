"""Checks of the whole machine: versions, groups, ports, Bluetooth, optional packages."""

from __future__ import annotations

import platform
import socket
import sys
from collections.abc import Iterator
from enum import StrEnum
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from diffbotctl import __version__
from diffbotctl.bluetooth.errors import AdapterStatus, adapter_status
from diffbotctl.control_socket.address import EngineAddress, engines
from diffbotctl.control_socket.client import ControlClient
from diffbotctl.errors import Problem, RunError
from diffbotctl.estimation.imu_text import imu_text
from diffbotctl.links.diffbot_states import gyro_fix
from diffbotctl.messages import Imu
from diffbotctl.ports.access import SystemUser, system_groups
from diffbotctl.ports.diagnosis import PortSurvey
from diffbotctl.ports.usb_ids import PortRole
from diffbotctl.recording.json_codec import message_reader

PYTHON_MIN_VERSION = (3, 11)
REQUIRED_PACKAGES = ("click", "cobs", "mcap", "numpy", "pyyaml", "rich", "textual", "zstandard")
SERIAL_GROUPS = ("dialout", "uucp", "plugdev")


class Verdict(StrEnum):
    """How a finding is to be taken: fine, worth knowing, in the way."""

    OK = "ok"
    NOTE = "--"
    BAD = "!!"


IMU_VERDICTS = {"working": Verdict.OK, "zeroing": Verdict.NOTE, "failed": Verdict.BAD}


class Package(NamedTuple):
    """An optional package of the system: the file that shows it, and what it is for."""

    name: str
    file: str
    purpose: str


PACKAGES = (
    Package("avrdude", "bin/avrdude", "`flash --programmer avrdude`, which is optional"),
    Package("gcc-avr", "bin/avr-gcc", "building the firmware; a built one is included"),
    Package("libsimavr-dev", "include/simavr/sim_avr.h", "`emulate` and `run --port emulated`"),
    Package("gcc", "bin/gcc", "`emulate` and `run --port emulated`"),
    Package("nodejs", "bin/node", "`emulate` and `run --port emulated` of a Pico"),
    Package("npm", "bin/npm", "the emulator of a Pico, whose package rp2040js it installs"),
)
PACKAGE_FOLDERS = ("usr", "usr/local", "")


class DoctorFinding(NamedTuple):
    """One line: the verdict, the topic, what was found, what to do."""

    verdict: Verdict
    topic: str
    text: str
    fix: str = ""


def doctor_findings(root: Path, user: SystemUser, survey: PortSurvey) -> Iterator[DoctorFinding]:
    """The result of every check, good or bad. Opens no port."""
    yield from _versions()
    yield _groups(root, user)
    yield from _ports(survey)
    yield from _bluetooth(adapter_status(root))
    yield from _packages(root)


def engine_findings() -> Iterator[DoctorFinding]:
    """The IMU of each running robot that has one."""
    for engine in engines():
        try:
            imus = list(_imus(engine))
        except RunError as error:
            cause = error.problems[0].cause
            yield DoctorFinding(Verdict.NOTE, "engine", f"{engine.name}: {cause}")
            continue
        for imu in imus:
            verdict = IMU_VERDICTS[imu.state]
            fix = gyro_fix(imu.cause) if verdict == Verdict.BAD else ""
            yield DoctorFinding(verdict, "IMU", f"{engine.name}: {imu_text(imu)}", fix)


def _imus(engine: EngineAddress) -> Iterator[Imu]:
    """The newest message of each IMU. Raises RunError when the engine does not answer."""
    client = ControlClient(engine, "diffbotctl doctor")
    try:
        for row in client.request("list_topics")["topics"]:
            if row["type"] == Imu.__name__ and row["messages"]:
                last = client.request("describe_topic", topic=row["topic"])["last"]
                yield message_reader(Imu)(last)
    finally:
        client.close()


def _versions() -> Iterator[DoctorFinding]:
    is_new_enough = sys.version_info[:2] >= PYTHON_MIN_VERSION
    text = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    if is_new_enough:
        yield DoctorFinding(Verdict.OK, "Python", text)
    else:
        yield DoctorFinding(Verdict.BAD, "Python", text, "install Python 3.11 or newer")
    yield DoctorFinding(Verdict.OK, "diffbotctl", __version__)
    versions = {name: _version(name) for name in REQUIRED_PACKAGES}
    missing = [name for name, number in versions.items() if number is None]
    if missing:
        text = f"not installed: {', '.join(missing)}"
        fix = f"python3 -m pip install {' '.join(missing)}"
        yield DoctorFinding(Verdict.BAD, "packages", text, fix)
    else:
        text = ", ".join(f"{name} {number}" for name, number in versions.items())
        yield DoctorFinding(Verdict.OK, "packages", text)


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _groups(root: Path, user: SystemUser) -> DoctorFinding:
    groups = [group for group in system_groups(root).values() if group.name in SERIAL_GROUPS]
    joined = [group.name for group in groups if group.number in user.groups]
    verdict, fix = Verdict.OK, ""
    if user.user == 0:
        text = "root has access to every port; diffbotctl does not need root"
    elif joined:
        text = f"{user.name} is in {', '.join(joined)}"
    elif any(user.name in group.members for group in groups):
        verdict, fix = Verdict.BAD, "log out and log in again"
        text = f"{user.name} is in a group, but this session began before that"
    else:
        name = groups[0].name if groups else SERIAL_GROUPS[0]
        verdict, text = Verdict.NOTE, f"{user.name} is in no group that owns serial ports"
        fix = f"sudo usermod -aG {name} {user.name}, then log out and in again"
    return DoctorFinding(verdict, "groups", text, fix)


def _ports(survey: PortSurvey) -> Iterator[DoctorFinding]:
    for report in survey.reports:
        # Only a port that may lead to a board can be in the way.
        may_be_board = report.port.usb is not None or report.port.role == PortRole.BLUETOOTH
        unusable = Verdict.BAD if may_be_board else Verdict.NOTE
        verdict = Verdict.OK if report.usable else unusable
        yield DoctorFinding(verdict, "port", f"{report.port.device}  {report.title}")
        for problem in report.problems:
            yield _problem_finding(problem, may_be_board)
    for problem in survey.problems:
        yield _problem_finding(problem, True)


def _problem_finding(problem: Problem, may_be_board: bool) -> DoctorFinding:
    is_bad = may_be_board and problem.severity != "warning"
    verdict = Verdict.BAD if is_bad else Verdict.NOTE
    return DoctorFinding(verdict, problem.code, f"{problem.place}: {problem.cause}", problem.fix)


def _bluetooth(adapters: AdapterStatus) -> Iterator[DoctorFinding]:
    """Whether a Bluetooth module could be reached; never in the way of a robot on a cable."""
    topic = "Bluetooth"
    if not hasattr(socket, "AF_BLUETOOTH"):
        text = "this Python was built without Bluetooth sockets"
        fix = "use the Python of the system: /usr/bin/python3 -m venv ..."
        yield DoctorFinding(Verdict.NOTE, topic, text, fix)
    if _version("jeepney") is None:
        text = "the package jeepney is not installed; `bluetooth scan` and `pair` need it"
        yield DoctorFinding(Verdict.NOTE, topic, text, "pip install 'diffbotctl[bluetooth]'")
    problem = adapters.problem
    if problem is None:
        text = f"{', '.join(adapters.names)} is present, the service is running"
        yield DoctorFinding(Verdict.OK, topic, text)
    else:
        yield DoctorFinding(Verdict.NOTE, topic, problem.cause, problem.fix)


def _packages(root: Path) -> Iterator[DoctorFinding]:
    for name, file, purpose in PACKAGES:
        if any((root / folder / file).exists() for folder in PACKAGE_FOLDERS):
            yield DoctorFinding(Verdict.OK, name, "installed")
        else:
            text = f"not installed; needed only for {purpose}"
            yield DoctorFinding(Verdict.NOTE, name, text, f"sudo apt-get install {name}")
