"""What stands between a person and each port, in words, with the way out.

A port that somebody named: there, gone, called something else by now, or no port at all.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from diffbotctl.errors import Problem
from diffbotctl.ports import access, usb_ids
from diffbotctl.ports.access import HIDDEN_USER, PortUser, SystemUser, port_user, system_groups
from diffbotctl.ports.sysfs import SerialPort, UsbDevice, serial_ports, usb_devices

NEVER_CHMOD = "Never chmod 777: it lasts until the cable is pulled, and lets anyone in"
REPLUG = "then plug the cable in anew"
RULE = f"install the udev rule that `diffbotctl doctor --fix` prints, {REPLUG}"
# What to do about a program that holds a port, by its name.
RELEASE_FIXES = {
    "diffbotctl": "end that run: Ctrl-C in its window, or `diffbotctl stop` and then end it",
    "ModemManager": "it lets go within half a minute; for good: sudo systemctl disable --now "
    "ModemManager",
    "brltty": "it takes the chip for a Braille display: sudo apt-get remove brltty, " + REPLUG,
    "screen": "end it: Ctrl-A, then K, in its window",
    "minicom": "end it: Ctrl-A, then X, in its window",
    "picocom": "end it: Ctrl-A, then Ctrl-X, in its window",
    "serial-monitor": "close the serial monitor of the Arduino IDE",
    "arduino-ide": "close the serial monitor of the Arduino IDE",
    "java": "close the serial monitor of the Arduino IDE",
    "serial_node.py": "end the ROS node: Ctrl-C in its window",
    "avrdude": "wait until it has finished",
    "agetty": "a login runs on this port: sudo systemctl disable --now serial-getty@{name}",
}
PERMISSION_CODES = ("E-PORT-RIGHTS", "E-PORT-SESSION", "E-PORT-RULE")
RFCOMM = "rfcomm"  # keeps the port that it made open; others may use it


class PortReport(NamedTuple):
    """One port and what is to be said of it; usable when none of it is an error."""

    port: SerialPort
    title: str
    holder: PortUser | None
    problems: tuple[Problem, ...]

    @property
    def usable(self) -> bool:
        """Whether a run could open it now."""
        return all(problem.severity == "warning" for problem in self.problems)

    @property
    def role(self) -> str:
        """The role of its USB identity (`chips`), or the kind of port."""
        usb = self.port.usb
        if usb is not None:
            return usb.kind.role if usb.kind else "unknown"
        return "bluetooth" if self.port.address or "rfcomm" in self.port.device else "onboard"


class PortSurvey(NamedTuple):
    """Every port of a machine, and what is wrong with none of them in particular."""

    reports: tuple[PortReport, ...]
    problems: tuple[Problem, ...]


def survey_ports(root: Path, person: SystemUser) -> PortSurvey:
    """Look at every port below `root`, for `person`. Opens none."""
    found = serial_ports(root)
    twins = _twins(found)
    reports = tuple(_report(root, person, port, twins) for port in found)
    lost = tuple(_portless(root, usb, reports) for usb in usb_devices(root))
    problems = [problem for problem in lost if problem is not None]
    return PortSurvey(reports, (*problems, *_count(reports, bool(problems))))


def _report(root: Path, person: SystemUser, port: SerialPort, twins: set[str]) -> PortReport:
    using = port_user(root, port.device)
    if using is not None and using.name.startswith(RFCOMM):
        using = None
    problems = [
        _rights(root, person, port),
        None if using is None else busy_problem(port.device, using),
        _console(root, port),
        *_other(port),
        *_trapped(root, port, using),
        _world(port),
        _twin(port, twins),
    ]
    return PortReport(port, report_title(port), using, tuple(filter(None, problems)))


def report_title(port: SerialPort) -> str:
    """What the port leads to, in a few words."""
    if port.usb is None:
        if port.device.startswith("/dev/rfcomm"):
            return f"Bluetooth {port.address}".rstrip()
        return "a serial port of the machine itself"
    known = port.usb.kind
    if known is None:
        return port.usb.title or f"unknown USB device {port.usb.identity}"
    if known.role == usb_ids.CHIP:
        return f"{known.title}: a clone of an Arduino, or another thing with this chip"
    return known.title


def port_problem(code: str, device: str, cause: str, fix: str) -> Problem:
    """A problem of one port; a code that begins with W is a warning."""
    severity = "warning" if code.startswith("W") else "error"
    return Problem(code, f"port {device}", cause, fix, severity)


def _rights(root: Path, person: SystemUser, port: SerialPort) -> Problem | None:
    path = root / port.device[1:]
    if person.may(path, port.mode, port.owner, port.group):
        return None
    known = system_groups(root)
    owning = known.get(port.group)
    name = owning.name if owning else f"number {port.group}"
    if owning is None or port.mode >> 3 & 0o6 != 0o6 or name == "root":
        cause = f"{person.name} may not open it, and no group could be joined: it belongs to {name}"
        fix = f"{RULE if port.usb else 'the system must give it to a group'}. {NEVER_CHMOD}"
        return port_problem("E-PORT-RULE", port.device, cause, fix)
    if person.name in owning.members:
        cause = f"{person.name} has joined the group {name}, but this session began before"
        fix = f"log out and in again; or, for one window: newgrp {name}"
        return port_problem("E-PORT-SESSION", port.device, cause, fix)
    cause = f"{person.name} may not open it; it belongs to the group {name}"
    fix = f"sudo usermod -aG {name} {person.name}, then log out and in again. {NEVER_CHMOD}"
    return port_problem("E-PORT-RIGHTS", port.device, cause, fix)


def busy_problem(device: str, using: PortUser) -> Problem:
    """Another program keeps the port; how to make it let go."""
    name = device.rpartition("/")[2]
    fix = RELEASE_FIXES.get(using.name, f"end that program (kill {using.process})").format(
        name=name
    )
    if using == HIDDEN_USER:
        fix = f"sudo fuser -v {device} tells which; end it"
    fix += "; two programs on one port garble each other"
    return port_problem("E-PORT-BUSY", device, f"it is in use by {using}", fix)


def _console(root: Path, port: SerialPort) -> Problem | None:
    if not access.is_console(root, port.device):
        return None
    fix = (
        "raspi-config, Interface Options, Serial Port: no login shell, hardware on; elsewhere "
        "take console=... out of the kernel's command line; then restart"
    )
    return port_problem("E-PORT-CONSOLE", port.device, "the system's login console runs on it", fix)


def _other(port: SerialPort) -> list[Problem | None]:
    known = port.usb.kind if port.usb else None
    if known is None:
        return []
    if known.role == usb_ids.NO_BOARD:
        return [
            port_problem(
                "W-PORT-OTHER",
                port.device,
                f"it leads to {known.title}, no board",
                "leave it alone; name another port with --port",
            )
        ]
    if known.role == usb_ids.OTHER_BOARD:
        return [
            port_problem(
                "W-PORT-BOARD",
                port.device,
                f"an {known.title} is no Mega 2560",
                "our firmware runs on a Mega 2560; with the book's firmware this board "
                "can be driven as book_2wd_stock",
            )
        ]
    return []


def _trapped(root: Path, port: SerialPort, using: PortUser | None) -> list[Problem | None]:
    usb = port.usb
    if usb is None or (usb.kind and usb.kind.role == usb_ids.NO_BOARD):
        return []
    found: list[Problem | None] = []
    if access.brltty_claims(root, usb):
        found.append(
            port_problem(
                "W-PORT-BRLTTY",
                port.device,
                "brltty's rules take this chip for a Braille display: "
                "the port may vanish a second after plugging in",
                f"sudo apt-get remove brltty, {REPLUG}",
            )
        )
    caught = using is not None and using.name == access.MODEM_MANAGER
    if not port.no_modem and not caught and access.modem_manager_runs(root):
        found.append(
            port_problem(
                "W-PORT-MODEM",
                port.device,
                "ModemManager runs, and may talk to a board that was just "
                "plugged in as if it were a modem",
                RULE,
            )
        )
    return found


def _world(port: SerialPort) -> Problem | None:
    if port.mode & 0o002 == 0:
        return None
    fix = "join the group that owns it instead; plug the cable in anew to undo the chmod"
    return port_problem("W-PORT-WORLD", port.device, "anyone on this machine may write to it", fix)


def _twins(found: list[SerialPort]) -> set[str]:
    """Devices that share one stable name, since their chips have no serial number."""
    seen: dict[tuple[str, str], list[str]] = {}
    for port in found:
        if port.usb is not None and not port.usb.serial:
            seen.setdefault((port.usb.identity, port.usb.title), []).append(port.device)
    return {device for devices in seen.values() if len(devices) > 1 for device in devices}


def _twin(port: SerialPort, twins: set[str]) -> Problem | None:
    if port.device not in twins:
        return None
    fix = f"name it by its socket: {port.place}" if port.place else "plug in one at a time"
    cause = (
        "another port has the same chip without a serial number, so by-id cannot tell them apart"
    )
    return port_problem("W-PORT-TWINS", port.device, cause, fix)


def _portless(root: Path, usb: UsbDevice, reports: tuple[PortReport, ...]) -> Problem | None:
    """A board's USB chip that has no serial port, and why."""
    known = usb.kind
    if known is None or known.role == usb_ids.NO_BOARD:
        return None
    if any(report.port.usb and report.port.usb.place == usb.place for report in reports):
        return None
    where = f"USB {usb.place}"
    if known.role == usb_ids.DFU:
        return Problem(
            "E-PORT-DFU",
            where,
            f"{known.title}: the board's USB chip waits for a "
            "program of its own, so the board has no port",
            "plug the cable in anew without touching the six pins beside the USB "
            "socket; if it stays so, the chip lost its program: DFU-program it as "
            "Arduino's page on the 16U2 says",
        )
    if "usbfs" in usb.drivers or access.brltty_claims(root, usb):
        return Problem(
            "E-PORT-BRLTTY",
            where,
            f"{known.title} is plugged in but has no port: "
            "brltty has taken it for a Braille display",
            f"sudo apt-get remove brltty, {REPLUG}",
        )
    return Problem(
        "E-PORT-DRIVER",
        where,
        f"{known.title} is plugged in but no driver serves it",
        f"sudo modprobe {known.module}; if that finds no module, the kernel was "
        "updated since the last start: restart the machine",
    )


def _count(reports: tuple[PortReport, ...], lost: bool) -> list[Problem]:
    boards = [each for each in reports if each.role in (usb_ids.MEGA, usb_ids.CHIP)]
    megas = [each for each in boards if each.role == usb_ids.MEGA] or boards
    if len(megas) > 1:
        names = [each.port.stable or each.port.device for each in megas]
        return [
            Problem(
                "W-PORT-SEVERAL",
                "ports",
                f"{len(megas)} ports may be the board: {', '.join(names)}",
                "name one with --port; unplug one and look again to see which is which",
                "warning",
            )
        ]
    radio = any(each.role == "bluetooth" for each in reports)
    if not boards and not radio and not lost:
        return [
            Problem(
                "W-PORT-NONE",
                "ports",
                "no board is plugged in",
                "plug the USB cable in (a charging cable has no data wires and shows "
                "nothing), or use --port bluetooth:ADDRESS",
                "warning",
            )
        ]
    return []


PTY = "/dev/pts/"


def diagnose_name(root: Path, seen: PortSurvey, name: str) -> PortReport | Problem | None:
    """What `name` leads to: its report, or why it cannot serve.

    None for a pseudo-terminal, such as an emulated board's: nothing is known of what is behind.
    """
    real = _real(root, name)
    for report in seen.reports:
        if report.port.device == real:
            return report
    path = root / real[1:]
    if not os.path.lexists(path):
        return _vanished(seen, name)
    if real.startswith(PTY):
        return None
    what = "a folder" if path.is_dir() else "no serial port"
    return port_problem("E-PORT-KIND", name, f"it is {what}", _instead(seen))


def _real(root: Path, name: str) -> str:
    """Where the name leads, links followed, as seen from inside the root."""
    path = name
    for _ in range(8):  # links to links; more is a ring
        inside = root / path.lstrip("/")
        if not inside.is_symlink():
            return path
        path = os.path.normpath(os.path.join(os.path.dirname(path), os.readlink(inside)))
    return path


def _vanished(seen: PortSurvey, name: str) -> Problem:
    boards = [each for each in seen.reports if each.role in (usb_ids.MEGA, usb_ids.CHIP)]
    if len(boards) == 1 and _plugged(name):
        now = boards[0].port
        better = now.stable or now.device
        return port_problem(
            "E-PORT-RENAMED",
            name,
            f"it is gone; the board is {now.device} now",
            f"use --port {better}, a name that stays"
            if now.stable
            else f"use --port {better}, or --port auto",
        )
    if "rfcomm" in name:
        return port_problem(
            "E-PORT-OPEN",
            name,
            "no Bluetooth module is bound to it",
            "use --port bluetooth:ADDRESS, which needs no rfcomm; `diffbotctl "
            "bluetooth scan` tells the address",
        )
    return port_problem("E-PORT-OPEN", name, "there is no such port", _instead(seen))


def _plugged(name: str) -> bool:
    return any(part in name for part in ("ttyUSB", "ttyACM", "by-id", "by-path"))


def _instead(seen: PortSurvey) -> str:
    names = [each.port.stable or each.port.device for each in seen.reports if each.usable]
    if names:
        return f"there is {', '.join(names)}"
    return "plug the board in; a charging cable has no data wires and shows nothing"
