"""Situations of serial ports, each on a machine of its own: is it named rightly, with its fix?

Most are folders that stand for a machine; where somebody must answer, real pseudo-terminals.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.errors import Problem
from diffbotctl.ports.access import SystemUser
from diffbotctl.ports.diagnosis import PortReport, diagnose_name, survey_ports
from tests.support.fake_machine import CH340, MEGA, FakeMachine

ANA = "ana"
USER = os.getuid() + 4000  # somebody who owns nothing here
MEMBER = frozenset({os.getgid()})
STRANGER: frozenset[int] = frozenset()
MEGA_NAME = "usb-Arduino_Mega_2560_75330303-if00"
CH340_NAME = "usb-1a86_USB_Serial-if00-port0"
BRLTTY = "usr/lib/udev/rules.d/85-brltty.rules"
BRLTTY_RULE = 'ENV{PRODUCT}=="1a86/7523/*", ENV{BRLTTY_BRAILLE_DRIVER}="bm", GOTO="brltty_usb_run"'


class Situation(NamedTuple):
    """The machine, who asks for which port, and the expected error: code, cause, fix."""

    name: str
    build: Callable[[FakeMachine], object]
    asked: str | None  # None: the problems of the machine as a whole
    code: str  # "" when nothing is wrong
    cause: str = ""
    fix: str = ""
    groups: frozenset[int] = MEMBER
    group: tuple[str, str] = ("dialout", ANA)  # that owns the ports, and its members


def mega(machine: FakeMachine, **options: Any) -> str:
    """A genuine Mega as ttyACM0."""
    return machine.port(
        "ttyACM0", MEGA, product="Mega 2560", serial="75330303", by_id=MEGA_NAME, **options
    )


def clone(machine: FakeMachine, name: str = "ttyUSB0", **options: Any) -> str:
    """A clone with a CH340."""
    return machine.port(name, CH340, **{"product": "USB Serial", **options})


def held(by: str) -> Callable[[FakeMachine], object]:
    """A Mega that a program has open."""
    return lambda machine: machine.program(by, mega(machine))


def console(machine: FakeMachine) -> None:
    """A Raspberry Pi as it comes: the login console on its UART."""
    machine.port("ttyAMA0", None)
    machine.write("proc/cmdline", "console=serial0,115200 console=tty1 root=/dev/mmcblk0p2\n")
    machine.link("dev/serial0", "dev/ttyAMA0")


def locked(machine: FakeMachine) -> None:
    """Another user's program: it shows its lock, not its files."""
    process = machine.program("python3")
    machine.lock(mega(machine), process)


def lock_unseen(machine: FakeMachine) -> None:
    """A lock from inside a container, whose process has no number here."""
    machine.lock(mega(machine), 0)


def moved(machine: FakeMachine) -> None:
    """The board came back under the next number, and the stale link is left."""
    clone(machine, "ttyUSB1", by_id=CH340_NAME)


def indistinct(machine: FakeMachine) -> None:
    """Two clones; the second took the by-id name from the first."""
    clone(machine, "ttyUSB0", place="1-1")
    clone(machine, "ttyUSB1", place="1-2", by_id=CH340_NAME)


def two_megas(machine: FakeMachine) -> None:
    """Two genuine boards."""
    mega(machine)
    machine.port("ttyACM1", MEGA, place="1-2", serial="9", by_id="usb-Arduino_9-if00")


def braille(machine: FakeMachine) -> None:
    """A clone that works still, and brltty's rules."""
    clone(machine)
    machine.write(BRLTTY, BRLTTY_RULE)


def braille_off(machine: FakeMachine) -> None:
    """Rules of brltty that do not name this chip any more."""
    clone(machine)
    machine.write(BRLTTY, "# " + BRLTTY_RULE)


def modem(machine: FakeMachine) -> None:
    """ModemManager beside a board."""
    mega(machine)
    machine.program("ModemManager")


def modem_configured(machine: FakeMachine) -> None:
    """ModemManager, configured to leave the board alone."""
    mega(machine, no_modem=True)
    machine.program("ModemManager")


def rfcomm_held(machine: FakeMachine) -> None:
    """`rfcomm connect` waits in a window, as it must."""
    machine.program("rfcomm", machine.rfcomm())


def file(machine: FakeMachine) -> None:
    """A file that was made by redirecting to a port that was not there."""
    machine.write("dev/ttyUSB7", "hello\n")


def known(identity: tuple[int, int], product: str = "") -> Callable[[FakeMachine], object]:
    """A port of another USB device."""
    return lambda machine: machine.port("ttyUSB0", identity, product=product)


A, U = "/dev/ttyACM0", "/dev/ttyUSB0"
USERMOD = "sudo usermod -aG {} ana, then log out and in"
SITUATIONS = [
    Situation("genuine Mega, all well", mega, A, ""),
    Situation("clone with CH340, all well", clone, U, ""),
    Situation("by its stable name", mega, f"/dev/serial/by-id/{MEGA_NAME}", ""),
    Situation(
        "not in dialout",
        mega,
        A,
        "E-PORT-RIGHTS",
        "group dialout",
        USERMOD.format("dialout"),
        STRANGER,
        ("dialout", ""),
    ),
    Situation(
        "not in uucp (Arch)",
        clone,
        U,
        "E-PORT-RIGHTS",
        "group uucp",
        USERMOD.format("uucp"),
        STRANGER,
        ("uucp", ""),
    ),
    Situation(
        "not in plugdev (Trixie)",
        clone,
        U,
        "E-PORT-RIGHTS",
        "group plugdev",
        USERMOD.format("plugdev"),
        STRANGER,
        ("plugdev", "bob"),
    ),
    Situation(
        "joined, old session",
        mega,
        A,
        "E-PORT-SESSION",
        "session began before",
        "newgrp dialout",
        STRANGER,
    ),
    Situation(
        "owned by root alone",
        lambda m: mega(m, mode=0o600),
        A,
        "E-PORT-RULE",
        "no group could be joined",
        "doctor --fix",
    ),
    Situation(
        "group may only read",
        lambda m: mega(m, mode=0o640),
        A,
        "E-PORT-RULE",
        "no group could be joined",
        "Never chmod 777",
    ),
    Situation(
        "chmod 666 by somebody",
        lambda m: clone(m, mode=0o666),
        U,
        "W-PORT-WORLD",
        "every user of this machine",
        "join the group",
        STRANGER,
    ),
    Situation(
        "held by screen", held("screen"), A, "E-PORT-BUSY", "screen (process 301)", "Ctrl-A, then K"
    ),
    Situation(
        "held by the Arduino IDE",
        held("serial-monitor"),
        A,
        "E-PORT-BUSY",
        "serial-monitor",
        "close the serial monitor",
    ),
    Situation(
        "held by another run", held("diffbotctl"), A, "E-PORT-BUSY", "diffbotctl", "diffbotctl stop"
    ),
    Situation(
        "held by the ROS node",
        held("serial_node.py"),
        A,
        "E-PORT-BUSY",
        "serial_node.py",
        "end the ROS node",
    ),
    Situation(
        "held by ModemManager",
        held("ModemManager"),
        A,
        "E-PORT-BUSY",
        "ModemManager",
        "disable --now ModemManager",
    ),
    Situation(
        "held by an unknown program", held("mystery"), A, "E-PORT-BUSY", "mystery", "kill 301"
    ),
    Situation(
        "held by a login", held("agetty"), A, "E-PORT-BUSY", "agetty", "serial-getty@ttyACM0"
    ),
    Situation(
        "locked by another user's program",
        locked,
        A,
        "E-PORT-BUSY",
        "python3 (process 301)",
        "kill 301",
    ),
    Situation(
        "locked from a container",
        lock_unseen,
        A,
        "E-PORT-BUSY",
        "another program",
        "sudo fuser -v /dev/ttyACM0",
    ),
    Situation(
        "asked by link, held",
        held("picocom"),
        f"/dev/serial/by-id/{MEGA_NAME}",
        "E-PORT-BUSY",
        "picocom",
        "Ctrl-X",
    ),
    Situation(
        "vanished, nothing else there",
        lambda m: None,
        A,
        "E-PORT-OPEN",
        "no such port",
        "charging cable",
    ),
    Situation(
        "vanished, another port is free",
        lambda m: m.port("ttyS1", None),
        "/dev/ttyS0",
        "E-PORT-OPEN",
        "no such port",
        "/dev/ttyS1",
    ),
    Situation(
        "renamed after a reconnect",
        moved,
        U,
        "E-PORT-RENAMED",
        "now /dev/ttyUSB1",
        f"/dev/serial/by-id/{CH340_NAME}",
    ),
    Situation(
        "stale by-id name",
        mega,
        f"/dev/serial/by-id/{CH340_NAME}",
        "E-PORT-RENAMED",
        "now /dev/ttyACM0",
        MEGA_NAME,
    ),
    Situation(
        "nothing plugged in", lambda m: None, None, "W-PORT-NONE", "no board", "charging cable"
    ),
    Situation("two genuine boards", two_megas, None, "W-PORT-SEVERAL", MEGA_NAME, "--port"),
    Situation(
        "two clones with one by-id name",
        indistinct,
        U,
        "W-PORT-INDISTINCT",
        "serial number",
        "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0",
    ),
    Situation(
        "clone without driver",
        lambda m: m.usb("1-1", CH340, "USB Serial"),
        None,
        "E-PORT-DRIVER",
        "CH340",
        "modprobe ch341",
    ),
    Situation(
        "clone taken by brltty",
        lambda m: m.usb("1-1", CH340, driver="usbfs"),
        None,
        "E-PORT-BRLTTY",
        "Braille",
        "apt-get remove brltty",
    ),
    Situation(
        "brltty lies in wait", braille, U, "W-PORT-BRLTTY", "Braille", "apt-get remove brltty"
    ),
    Situation("brltty's rule is commented out", braille_off, U, ""),
    Situation(
        "Mega's USB chip in DFU",
        lambda m: m.usb("1-1", (0x03EB, 0x2FEF)),
        None,
        "E-PORT-DFU",
        "own program",
        "unplug the cable",
    ),
    Situation("ModemManager lies in wait", modem, A, "W-PORT-MODEM", "modem", "doctor --fix"),
    Situation("ModemManager was configured", modem_configured, A, ""),
    Situation("an Uno", known((0x2341, 0x0043)), U, ""),
    Situation(
        "a Leonardo", known((0x2341, 0x8036)), U, "W-PORT-BOARD", "Leonardo", "book_2wd_stock"
    ),
    Situation(
        "a Pico with MicroPython",
        known((0x2E8A, 0x0005)),
        U,
        "W-PORT-BOARD",
        "MicroPython",
        "flash firmware",
    ),
    Situation(
        "a phone modem",
        known((0x12D1, 0x1506)),
        U,
        "W-PORT-OTHER",
        "Huawei modem",
        "leave it alone",
    ),
    Situation(
        "login console on a Pi's UART",
        console,
        "/dev/ttyAMA0",
        "E-PORT-CONSOLE",
        "login console",
        "raspi-config",
    ),
    Situation("rfcomm0, bound", rfcomm_held, "/dev/rfcomm0", ""),
    Situation(
        "rfcomm0, not bound",
        lambda m: None,
        "/dev/rfcomm0",
        "E-PORT-OPEN",
        "no Bluetooth module is bound",
        "--port bluetooth:ADDRESS",
    ),
    Situation("pseudo-terminal", lambda m: m.write("dev/pts/3", ""), "/dev/pts/3", ""),
    Situation("a plain file", file, "/dev/ttyUSB7", "E-PORT-KIND", "not a serial port", "connect"),
    Situation("a folder", mega, "/dev/serial", "E-PORT-KIND", "a folder", MEGA_NAME),
]


def problems_of(situation: Situation, folder: Path) -> tuple[Problem, ...]:
    """The problems of the situation, on a machine built in `folder`."""
    machine = FakeMachine(folder, *situation.group)
    situation.build(machine)
    person = SystemUser(ANA, USER, situation.groups)
    seen = survey_ports(machine.root, person)
    if situation.asked is None:
        return seen.problems
    found = diagnose_name(machine.root, seen, situation.asked)
    if isinstance(found, PortReport):
        return found.problems
    return () if found is None else (found,)


def right(situation: Situation, problems: tuple[Problem, ...]) -> bool:
    """Whether exactly this was reported: one problem, its code, its cause, its fix."""
    if not situation.code:
        return not problems
    return [problem.code for problem in problems] == [situation.code] and (
        situation.cause in problems[0].cause and situation.fix in problems[0].fix
    )
