"""What the Bluetooth service's errors mean to somebody with a module in the hand.

The machine's own Bluetooth radio, as the kernel and its process list show it.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from diffbotctl.bluetooth.dbus import BusError
from diffbotctl.errors import Problem, RunError
from diffbotctl.ports.access import running_programs
from diffbotctl.ports.sysfs import read_text

PLACE = "Bluetooth"
NO_SERVICE = ("ServiceUnknown", "NameHasNoOwner", "NoReply", "timeout")


def no_radio() -> RunError:
    """The service knows no radio."""
    return _error(
        "E-BLUETOOTH-ADAPTER",
        PLACE,
        "this machine has no Bluetooth radio",
        "plug in a Bluetooth stick, or drive over the USB cable",
    )


def not_found(address: str) -> RunError:
    """The module does not answer."""
    return _error(
        "E-BLUETOOTH-ABSENT",
        f"module {address}",
        "it does not answer",
        "is it powered (its light blinks fast), near, and not connected elsewhere (its "
        "light blinks twice every two seconds)?",
    )


def not_paired(address: str, error: BusError, asked: bool) -> RunError:
    """Pairing failed; `asked`: the module's number was wanted, so the module is there."""
    name = error.name.rpartition(".")[2]
    place = f"module {address}"
    if name in ("ConnectionAttemptFailed", "timeout", "AuthenticationTimeout") and not asked:
        return not_found(address)
    if name in ("AuthenticationFailed", "AuthenticationRejected"):
        return _error(
            "E-BLUETOOTH-PAIR",
            place,
            "the module does not accept this number",
            "most have 1234, some 0000: --pin 0000; if it was paired before, forget that "
            "first: --again",
        )
    return _error(
        "E-BLUETOOTH-PAIR",
        place,
        f"pairing failed: {error.text or name}",
        "switch the module off and on and try again; if it was paired before, --again",
    )


def refused(error: BusError) -> RunError:
    """The service does not do as asked."""
    name = error.name.rpartition(".")[2]
    if name in NO_SERVICE:
        return _error(
            "E-BLUETOOTH-SERVICE",
            PLACE,
            "the system's Bluetooth service does not answer",
            "sudo apt-get install bluez; sudo systemctl enable --now bluetooth",
        )
    if name == "AccessDenied":
        return _error(
            "E-BLUETOOTH-SERVICE",
            PLACE,
            "you may not ask the Bluetooth service",
            "sudo usermod -aG bluetooth $USER, then log out and in again",
        )
    if name in ("NotReady", "Blocked") or "rfkill" in error.text.lower():
        return _error(
            "E-BLUETOOTH-BLOCKED",
            PLACE,
            "the radio is switched off",
            "rfkill unblock bluetooth; `diffbotctl doctor` tells more",
        )
    return _error(
        "E-BLUETOOTH-SERVICE",
        PLACE,
        f"the service refuses: {error.text or name}",
        "sudo systemctl restart bluetooth, and try again",
    )


def _error(code: str, place: str, cause: str, fix: str) -> RunError:
    return RunError(Problem(code, place, cause, fix))


class AdapterStatus(NamedTuple):
    """What is there, and what is the matter with it, if anything."""

    names: tuple[str, ...]  # hci0 and the like
    trouble: Problem | None


def adapter_status(root: Path) -> AdapterStatus:
    """Look below `root`, a folder that stands for `/`."""
    folder = root / "sys/class/bluetooth"
    found = sorted(each.name for each in folder.glob("hci*") if ":" not in each.name)
    return AdapterStatus(tuple(found), _trouble(root, found))


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
    if not any(program.name == "bluetoothd" for program in running_programs(root)):
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
        if read_text(switch / "type") == "bluetooth"
        for state in ("hard", "soft")
        if read_text(switch / state) == "1"
    }
    return "hard" if "hard" in states else "soft" if states else ""
