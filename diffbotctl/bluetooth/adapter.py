"""The machine's own Bluetooth radio, as the kernel and its process list show it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from diffbotctl.errors import Problem
from diffbotctl.ports.port_users import programs
from diffbotctl.ports.sysfs import text


class Adapter(NamedTuple):
    """What is there, and what is the matter with it, if anything."""

    names: tuple[str, ...]  # hci0 and the like
    trouble: Problem | None


def adapter(root: Path) -> Adapter:
    """Look below `root`, a folder that stands for `/`."""
    folder = root / "sys/class/bluetooth"
    found = sorted(each.name for each in folder.glob("hci*") if ":" not in each.name)
    return Adapter(tuple(found), _trouble(root, found))


def _trouble(root: Path, names: list[str]) -> Problem | None:
    blocked = _blocked(root)
    if blocked == "hard":
        return _problem(
            "E-BLUETOOTH-BLOCKED",
            "Bluetooth is switched off by a switch or key",
            "move the switch on the machine, or press its wireless key",
        )
    if blocked == "soft":
        return _problem(
            "E-BLUETOOTH-BLOCKED",
            "Bluetooth is switched off by software",
            "rfkill unblock bluetooth, or switch it on in the settings",
        )
    if not names:
        return _problem(
            "E-BLUETOOTH-ADAPTER",
            "this machine has no Bluetooth radio",
            "plug in a Bluetooth stick, or drive over the USB cable",
        )
    if not any(program.name == "bluetoothd" for program in programs(root)):
        return _problem(
            "E-BLUETOOTH-SERVICE",
            "the system's Bluetooth service does not run",
            "sudo apt-get install bluez; sudo systemctl enable --now bluetooth",
        )
    return None


def _problem(code: str, cause: str, fix: str) -> Problem:
    return Problem(code, "Bluetooth", cause, fix)


def _blocked(root: Path) -> str:
    """`hard`, `soft`, or "" when the radio may send."""
    states = {
        state
        for switch in (root / "sys/class/rfkill").glob("rfkill*")
        if text(switch / "type") == "bluetooth"
        for state in ("hard", "soft")
        if text(switch / state) == "1"
    }
    return "hard" if "hard" in states else "soft" if states else ""
