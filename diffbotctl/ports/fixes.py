"""The shell commands that fix the problems of ports, for a person to read and run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from diffbotctl.ports.access import SystemUser, system_groups
from diffbotctl.ports.diagnosis import PortReport, PortSurvey
from diffbotctl.ports.sysfs import UsbDevice, usb_devices

BRLTTY_COMMAND = "sudo apt-get remove brltty"
RULES_FILE = "/etc/udev/rules.d/70-diffbotctl.rules"  # below 73, where uaccess takes effect
RELOAD_COMMAND = "sudo udevadm control --reload && sudo udevadm trigger"


def fix_commands(root: Path, survey: PortSurvey, user: SystemUser) -> list[str]:
    """Shell commands, each once, in the order to run them; empty when there is nothing to fix."""
    commands = [
        command for report in survey.reports for command in _port_commands(root, report, user)
    ]
    codes = {problem.code for problem in survey.problems}
    if "E-PORT-BRLTTY" in codes:
        commands.append(BRLTTY_COMMAND)
    if "E-PORT-DRIVER" in codes:
        chips = [usb.chip for usb in usb_devices(root)]
        commands += [f"sudo modprobe {chip.module}" for chip in chips if chip and chip.module]
    if any(RULES_FILE in command for command in commands):
        commands.append(RELOAD_COMMAND)
    return list(dict.fromkeys(commands))


def _port_commands(root: Path, report: PortReport, user: SystemUser) -> Iterator[str]:
    codes = {problem.code for problem in report.problems}
    if "E-PORT-RIGHTS" in codes:
        group = system_groups(root)[report.port.group]
        yield f"sudo usermod -aG {group.name} {user.name}"
    if "W-PORT-BRLTTY" in codes:
        yield BRLTTY_COMMAND
    if report.port.usb is not None and codes & {"E-PORT-RULE", "W-PORT-MODEM"}:
        yield f"echo '{udev_rule(report.port.usb)}' | sudo tee -a {RULES_FILE}"


def udev_rule(usb: UsbDevice) -> str:
    """One line for one USB identity: gives its ports to a group, keeps other programs off them."""
    return (
        f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{usb.vendor:04x}", '
        f'ATTRS{{idProduct}}=="{usb.product:04x}", GROUP="dialout", MODE="0660", '
        'TAG+="uaccess", ENV{ID_MM_DEVICE_IGNORE}="1"'
    )
