"""What prevents the use of each port, with the fix; and what a port name leads to.

A named port can be there, gone, under another name by now, or no port at all.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from diffbotctl.errors import Problem, closest_match, join_words
from diffbotctl.ports import access
from diffbotctl.ports.access import HIDDEN_USER, PortUser, SystemUser, port_user, system_groups
from diffbotctl.ports.sysfs import SerialPort, UsbDevice, real_path, serial_ports, usb_devices
from diffbotctl.ports.usb_ids import PortRole, UsbChip

NEVER_CHMOD = "Never chmod 777: it lasts until the cable is unplugged, and gives access to everyone"
REPLUG = "then unplug the cable and plug it in again"
RULE_FIX = f"install the udev rule that `diffbotctl doctor --fix` prints, {REPLUG}"
BRLTTY_FIX = f"sudo apt-get remove brltty, {REPLUG}"
SERIAL_MONITOR_FIX = "close the serial monitor of the Arduino IDE"
# How to make a program release a port, by its name.
RELEASE_FIXES = {
    "diffbotctl": "end that run: press Ctrl-C in its window, or `diffbotctl stop`, then end it",
    "ModemManager": "it releases the port within 30 s; permanently: sudo systemctl disable --now "
    "ModemManager",
    "brltty": f"it treats the chip as a Braille display: {BRLTTY_FIX}",
    "screen": "end it: press Ctrl-A, then K, in its window",
    "minicom": "end it: press Ctrl-A, then X, in its window",
    "picocom": "end it: press Ctrl-A, then Ctrl-X, in its window",
    "serial-monitor": SERIAL_MONITOR_FIX,
    "arduino-ide": SERIAL_MONITOR_FIX,
    "java": SERIAL_MONITOR_FIX,
    "serial_node.py": "end the ROS node: press Ctrl-C in its window",
    "avrdude": "wait until it has finished",
    "agetty": "a login program uses this port: sudo systemctl disable --now serial-getty@{name}",
}
PERMISSION_CODES = ("E-PORT-RIGHTS", "E-PORT-SESSION", "E-PORT-RULE")
RFCOMM_PROGRAM = "rfcomm"  # keeps the port that it made open; others may use it
BOARD_ROLES = (PortRole.BOARD, PortRole.CHIP)
# Of ports that are never chosen, but may lead to a board that the user names.
UNLISTED_ROLES = (PortRole.UNKNOWN, PortRole.OTHER_BOARD, PortRole.OTHER_PROGRAM)
PTY_FOLDER = "/dev/pts/"
CONNECT_FIX = "connect the board (a charging cable does not work)"
DEVICES_NAMED = 2  # in place of a missing port, so that the error keeps to two lines


class PortReport(NamedTuple):
    """One port and its problems."""

    port: SerialPort
    title: str
    user: PortUser | None
    problems: tuple[Problem, ...]

    @property
    def usable(self) -> bool:
        """Whether a run could open it now: none of the problems is an error."""
        return all(problem.severity == "warning" for problem in self.problems)


class PortSurvey(NamedTuple):
    """Every port of a machine, and the problems of no port in particular."""

    reports: tuple[PortReport, ...]
    problems: tuple[Problem, ...]


def survey_ports(root: Path, user: SystemUser) -> PortSurvey:
    """Examine every port below `root`, for `user`. Opens none."""
    ports = serial_ports(root)
    indistinct = _indistinct_devices(ports)
    reports = []
    for port in ports:
        holder = port_user(root, port.device)
        if holder is not None and holder.name.startswith(RFCOMM_PROGRAM):
            holder = None
        problems = [
            *_permission_problems(root, user, port),
            *([] if holder is None else [busy_problem(port.device, holder)]),
            *_console_problems(root, port),
            *_chip_problems(port),
            *_service_problems(root, port, holder),
            *_mode_problems(port),
            *(_indistinct_problems(port) if port.device in indistinct else []),
        ]
        reports.append(PortReport(port, _title(port), holder, tuple(problems)))
    places = {port.usb.place for port in ports if port.usb}
    portless = [
        _portless_problem(root, usb, usb.chip)
        for usb in usb_devices(root)
        if usb.chip
        and (usb.chip.module or usb.chip.role == PortRole.DFU)
        and usb.place not in places
    ]
    problems = [*portless, *_board_count_problems(ports, bool(portless))]
    return PortSurvey(tuple(reports), tuple(problems))


def _title(port: SerialPort) -> str:
    """What the port leads to, in a few words."""
    if port.usb is None:
        if port.device.startswith("/dev/rfcomm"):
            return f"Bluetooth {port.address}".rstrip()
        return "an onboard serial port"
    chip = port.usb.chip
    if chip is None or not chip.module:
        known = chip.title if chip else "USB device"
        name = f"{port.usb.title} ({known})" if chip and port.usb.title else port.usb.title or known
        return f"{name} {port.usb.identity}"
    if chip.role == PortRole.OTHER_PROGRAM:
        return f"Raspberry Pi Pico with {chip.title}"
    if chip.role == PortRole.CHIP:
        return f"{chip.title}: an Arduino clone, a lidar, or another device with this chip"
    return chip.title


def _problem(place: str, code: str, cause: str, fix: str) -> Problem:
    """A problem; a code that begins with W is a warning."""
    return Problem(code, place, cause, fix, "warning" if code.startswith("W") else "error")


def _port_problem(device: str, code: str, cause: str, fix: str) -> Problem:
    return _problem(f"port {device}", code, cause, fix)


def _permission_problems(root: Path, user: SystemUser, port: SerialPort) -> Iterator[Problem]:
    if user.may(root / port.device[1:], port.mode, port.owner, port.group):
        return
    group = system_groups(root).get(port.group)
    name = group.name if group else f"number {port.group}"
    if group is None or port.mode >> 3 & access.READ_WRITE != access.READ_WRITE or name == "root":
        code = "E-PORT-RULE"
        cause = f"{user.name} has no permission, and no group could be joined: it belongs to {name}"
        fix = f"{RULE_FIX if port.usb else 'assign it to a group with a udev rule'}. {NEVER_CHMOD}"
    elif user.name in group.members:
        code = "E-PORT-SESSION"
        cause = f"{user.name} is in the group {name}, but this session began before that"
        fix = f"log out and in again; or, in this window only: newgrp {name}"
    else:
        code = "E-PORT-RIGHTS"
        cause = f"{user.name} has no permission; it belongs to the group {name}"
        fix = f"sudo usermod -aG {name} {user.name}, then log out and in again. {NEVER_CHMOD}"
    yield _port_problem(port.device, code, cause, fix)


def busy_problem(device: str, user: PortUser) -> Problem:
    """Another program uses the port; how to make it release it."""
    name = device.rpartition("/")[2]
    fix = RELEASE_FIXES.get(user.name, f"end that program (kill {user.process})").format(name=name)
    if user == HIDDEN_USER:
        fix = f"find it with sudo fuser -v {device}, and end it"
    fix += "; two programs on one port corrupt the data of both"
    return _port_problem(device, "E-PORT-BUSY", f"it is in use by {user}", fix)


def _console_problems(root: Path, port: SerialPort) -> Iterator[Problem]:
    if access.is_console(root, port.device):
        cause = "the system's login console runs on it"
        fix = (
            "in raspi-config, Interface Options, Serial Port: disable the login shell, enable the "
            "hardware; on other systems remove console=... from the kernel's command line; restart"
        )
        yield _port_problem(port.device, "E-PORT-CONSOLE", cause, fix)


def _chip_problems(port: SerialPort) -> Iterator[Problem]:
    chip = port.usb.chip if port.usb else None
    if chip is None:
        return
    if chip.role == PortRole.NO_BOARD:
        cause = f"it is {chip.title}, not a board"
        fix = "leave it alone; name another port with --port"
        yield _port_problem(port.device, "W-PORT-OTHER", cause, fix)
    elif chip.role == PortRole.OTHER_PROGRAM:
        cause = f"this Pico runs {chip.title}, not our firmware"
        fix = (
            "write the firmware: `diffbotctl flash firmware` brings it to BOOTSEL by itself; save "
            "your programs first"
        )
        yield _port_problem(port.device, "W-PORT-BOARD", cause, fix)
    elif chip.role == PortRole.OTHER_BOARD:
        article = "an" if chip.title[0] in "AEIOU" else "a"
        cause = f"our firmware does not run on {article} {chip.title}"
        fix = (
            "use a Mega 2560, an Uno, a Nano or a Pico; with the firmware of the book this board "
            "works as book_2wd_stock"
        )
        yield _port_problem(port.device, "W-PORT-BOARD", cause, fix)


def _service_problems(root: Path, port: SerialPort, holder: PortUser | None) -> Iterator[Problem]:
    if port.usb is None or port.role == PortRole.NO_BOARD:
        return
    if access.brltty_claims(root, port.usb):
        cause = (
            "brltty's rules claim this chip for a Braille display: "
            "the port may disappear one second after plugging in"
        )
        yield _port_problem(port.device, "W-PORT-BRLTTY", cause, BRLTTY_FIX)
    is_held = holder is not None and holder.name == access.MODEM_MANAGER
    if not port.no_modem and not is_held and access.modem_manager_runs(root):
        cause = "ModemManager runs, and may send modem commands to a board that was just plugged in"
        yield _port_problem(port.device, "W-PORT-MODEM", cause, RULE_FIX)


def _mode_problems(port: SerialPort) -> Iterator[Problem]:
    if port.mode & 0o002:
        fix = "join the group that owns it instead; unplug and plug the cable to undo the chmod"
        cause = "every user of this machine may write to it"
        yield _port_problem(port.device, "W-PORT-WORLD", cause, fix)


def _indistinct_devices(ports: list[SerialPort]) -> set[str]:
    """Devices that share one stable name, since their chips have no serial number."""
    devices: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for port in ports:
        if port.usb is not None and not port.usb.serial:
            devices[port.usb.identity, port.usb.title].append(port.device)
    return {device for group in devices.values() if len(group) > 1 for device in group}


def _indistinct_problems(port: SerialPort) -> Iterator[Problem]:
    fix = (
        f"use the name of its USB socket: {port.place}"
        if port.place
        else "plug in one board at a time"
    )
    cause = (
        "another port has the same chip without a serial number, so by-id cannot distinguish them"
    )
    yield _port_problem(port.device, "W-PORT-INDISTINCT", cause, fix)


def _portless_problem(root: Path, usb: UsbDevice, chip: UsbChip) -> Problem:
    """Why a board's USB chip has no serial port."""
    if chip.role == PortRole.DFU:
        code = "E-PORT-DFU"
        cause = (
            f"{chip.title}: the board's USB chip waits for its "
            "own program, so the board has no port"
        )
        fix = (
            "unplug the cable and plug it in again without touching the six pins beside the USB "
            "socket; if that does not help, the chip has lost its program: install it by DFU, see "
            "Arduino's page on the 16U2"
        )
    elif "usbfs" in usb.drivers or access.brltty_claims(root, usb):
        code, fix = "E-PORT-BRLTTY", BRLTTY_FIX
        cause = f"{chip.title} has no port: brltty has claimed it for a Braille display"
    else:
        code = "E-PORT-DRIVER"
        cause = f"{chip.title} is plugged in but has no driver"
        fix = (
            f"sudo modprobe {chip.module}; if it finds no module, the kernel was "
            "updated since the last boot: reboot"
        )
    return _problem(f"USB {usb.place}", code, cause, fix)


def _board_count_problems(ports: list[SerialPort], has_portless: bool) -> Iterator[Problem]:
    boards = [port for port in ports if port.role in BOARD_ROLES]
    boards = [port for port in boards if port.role == PortRole.BOARD] or boards
    if len(boards) > 1:
        cause = f"{len(boards)} ports may be the board: {', '.join(port.name for port in boards)}"
        fix = "choose one with --port; to identify them, unplug one and list the ports again"
        yield _problem("ports", "W-PORT-SEVERAL", cause, fix)
    has_radio = any(port.role == PortRole.BLUETOOTH for port in ports)
    if not boards and not has_radio and not has_portless:
        others = unlisted_ports(ports)
        cause = "no board is connected"
        fix = (
            "plug the USB cable in (a charging cable has no data wires and does not work), "
            "or use --port bluetooth:ADDRESS"
        )
        if others:
            cause = f"no board of a known kind is connected; {other_ports_text(others)}"
            fix = f"if it is the robot's board, name it: --port {others[0].name}"
        yield _problem("ports", "W-PORT-NONE", cause, fix)


def unlisted_ports(ports: Sequence[SerialPort]) -> list[SerialPort]:
    """The ports that are not chosen automatically, and may lead to a board all the same."""
    return [port for port in ports if port.role in UNLISTED_ROLES]


def other_ports_text(ports: Sequence[SerialPort]) -> str:
    """Each port with what it leads to, as far as that is known."""
    return ", ".join(f"{port.device} is {_title(port)}" for port in ports)


def diagnose_name(root: Path, survey: PortSurvey, name: str) -> PortReport | Problem | None:
    """What `name` leads to: its report, or why it cannot be used.

    None for a pseudo-terminal, such as that of an emulated board: nothing is known about it.
    """
    device = real_path(root, name)
    for report in survey.reports:
        if report.port.device == device:
            return report
    path = root / device[1:]
    if not os.path.lexists(path):
        return missing_problem(survey, name)
    if device.startswith(PTY_FOLDER):
        return None
    kind = "a folder" if path.is_dir() else "not a serial port"
    return _port_problem(name, "E-PORT-KIND", f"it is {kind}", _alternatives(survey))


def missing_problem(survey: PortSurvey, name: str, words: Sequence[str] = ()) -> Problem:
    """Why there is no port `name`, and what to use; `words` could be given in place of a port."""
    boards = [report.port for report in survey.reports if report.port.role in BOARD_ROLES]
    is_usb = any(part in name for part in ("ttyUSB", "ttyACM", "by-id", "by-path"))
    if len(boards) == 1 and is_usb:
        board = boards[0]
        cause = f"it is disconnected; the board is now {board.device}"
        fix = f"use --port {board.name}, " + (
            "which is a stable name" if board.stable else "or --port auto"
        )
        return _port_problem(name, "E-PORT-RENAMED", cause, fix)
    if "rfcomm" in name:
        cause = "no Bluetooth module is bound to it"
        return _port_problem(name, "E-PORT-OPEN", cause, "use --port bluetooth:ADDRESS")
    devices = [report.port.device for report in survey.reports if report.usable]
    meant = [word for word in words if name.lower().startswith(word)]  # `SIM`, `simulated`
    near = meant[0] if meant else closest_match(name, [*words, *devices])
    if near is not None:
        fix = f"did you mean {near}?"
    elif devices:
        more = len(devices) - DEVICES_NAMED
        fix = f"available: {', '.join(devices[:DEVICES_NAMED])}"
        fix += f" and {more} more" if more > 0 else ""
    else:
        fix = _no_usable_port_fix(survey)
    return _port_problem(name, "E-PORT-OPEN", "there is no such port", fix)


def _alternatives(survey: PortSurvey) -> str:
    names = [report.port.name for report in survey.reports if report.usable]
    if names:
        return f"available: {', '.join(names)}"
    return _no_usable_port_fix(survey)


def _no_usable_port_fix(survey: PortSurvey) -> str:
    devices = [report.port.device for report in survey.reports if report.port.usb]
    if not devices:
        return CONNECT_FIX
    return f"`diffbotctl ports` names what {join_words(devices, 'and')} needs"
