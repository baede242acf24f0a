"""The exact commands that mend what was found, for a person to read and run."""

from __future__ import annotations

from pathlib import Path

from diffbotctl.ports.judge import Report, Survey
from diffbotctl.ports.person import Person, groups
from diffbotctl.ports.rule import FILE, RELOAD, rule
from diffbotctl.ports.tree import usb_devices

BRLTTY = "sudo apt-get remove brltty"


def commands(root: Path, seen: Survey, person: Person) -> list[str]:
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


def _of(root: Path, report: Report, person: Person) -> list[str]:
    codes = {problem.code for problem in report.problems}
    found = []
    if "E-PORT-RIGHTS" in codes:
        name = groups(root)[report.port.group].name
        found.append(f"sudo usermod -aG {name} {person.name}")
    if "W-PORT-BRLTTY" in codes:
        found.append(BRLTTY)
    if report.port.usb is not None and codes & {"E-PORT-RULE", "W-PORT-MODEM"}:
        found.append(f"echo '{rule(report.port.usb)}' | sudo tee -a {FILE}")
    return found
