"""The exact commands that mend what was found, for a person to read and run.

The udev rule that gives a port to its people, and keeps other programs off it.
"""

from __future__ import annotations

from pathlib import Path

from diffbotctl.ports.access import SystemUser, system_groups
from diffbotctl.ports.diagnosis import PortReport, PortSurvey
from diffbotctl.ports.sysfs import UsbDevice, usb_devices

BRLTTY = "sudo apt-get remove brltty"


def fix_commands(root: Path, seen: PortSurvey, person: SystemUser) -> list[str]:
    """Shell commands, each once, in the order to run them; empty when nothing is to be mended."""
    found: list[str] = []
    for report in seen.reports:
        found += _of(root, report, person)
    codes = {problem.code for problem in seen.problems}
    if "E-PORT-BRLTTY" in codes:
        found.append(BRLTTY)
    if "E-PORT-DRIVER" in codes:
        kinds = [usb.kind for usb in usb_devices(root)]
        found += [f"sudo modprobe {kind.module}" for kind in kinds if kind and kind.module]
    rules = [command for command in found if FILE in command]
    return list(dict.fromkeys(found)) + ([RELOAD] if rules else [])


def _of(root: Path, report: PortReport, person: SystemUser) -> list[str]:
    codes = {problem.code for problem in report.problems}
    found = []
    if "E-PORT-RIGHTS" in codes:
        name = system_groups(root)[report.port.group].name
        found.append(f"sudo usermod -aG {name} {person.name}")
    if "W-PORT-BRLTTY" in codes:
        found.append(BRLTTY)
    if report.port.usb is not None and codes & {"E-PORT-RULE", "W-PORT-MODEM"}:
        found.append(f"echo '{udev_rule(report.port.usb)}' | sudo tee -a {FILE}")
    return found


FILE = "/etc/udev/rules.d/70-diffbotctl.rules"  # below 73, where uaccess takes effect
RELOAD = "sudo udevadm control --reload && sudo udevadm trigger"


def udev_rule(usb: UsbDevice) -> str:
    """One line for one kind of USB device."""
    return (
        f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{usb.vendor:04x}", '
        f'ATTRS{{idProduct}}=="{usb.product:04x}", GROUP="dialout", MODE="0660", '
        'TAG+="uaccess", ENV{ID_MM_DEVICE_IGNORE}="1"'
    )
