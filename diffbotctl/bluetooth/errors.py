"""Problems of Bluetooth: the radio as the kernel shows it, and the errors of the service."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from diffbotctl.bluetooth.dbus import PLACE, START_FIX, BusError
from diffbotctl.errors import Problem, RunError
from diffbotctl.ports.access import running_programs
from diffbotctl.ports.sysfs import read_text

NO_SERVICE = ("ServiceUnknown", "NameHasNoOwner", "NoReply", "timeout")
NO_ADAPTER = Problem(
    "E-BLUETOOTH-ADAPTER",
    PLACE,
    "this machine has no Bluetooth radio",
    "plug in a Bluetooth adapter, or use the USB cable",
)


class AdapterStatus(NamedTuple):
    """The Bluetooth radios of the machine, and what prevents their use, if anything."""

    names: tuple[str, ...]  # hci0 and the like
    problem: Problem | None


def adapter_status(root: Path) -> AdapterStatus:
    """The radios below `root`, a folder that stands for `/`."""
    entries = (root / "sys/class/bluetooth").glob("hci*")
    names = sorted(entry.name for entry in entries if ":" not in entry.name)  # hci0:1: a connection
    return AdapterStatus(tuple(names), _adapter_problem(root, names))


def _adapter_problem(root: Path, names: list[str]) -> Problem | None:
    blocks = _blocks(root)
    if "hard" in blocks:
        cause = "Bluetooth is disabled by a hardware switch or key"
        fix = "use the switch of the machine, or press its wireless key"
        return Problem("E-BLUETOOTH-BLOCKED", PLACE, cause, fix)
    if "soft" in blocks:
        cause = "Bluetooth is disabled by software"
        fix = "run rfkill unblock bluetooth, or enable it in the settings"
        return Problem("E-BLUETOOTH-BLOCKED", PLACE, cause, fix)
    if not names:
        return NO_ADAPTER
    if not any(program.name == "bluetoothd" for program in running_programs(root)):
        cause = "the system's Bluetooth service is not running"
        return Problem("E-BLUETOOTH-SERVICE", PLACE, cause, START_FIX)
    return None


def _blocks(root: Path) -> set[str]:
    """The switches that keep the radio from sending: `hard`, `soft`."""
    return {
        switch
        for folder in (root / "sys/class/rfkill").glob("rfkill*")
        if read_text(folder / "type") == "bluetooth"
        for switch in ("hard", "soft")
        if read_text(folder / switch) == "1"
    }


def not_found(address: str) -> RunError:
    """The module does not answer."""
    fix = (
        "check that it has power (its light blinks fast), is in range, and is not connected to "
        "another device (its light blinks twice every two seconds)"
    )
    return RunError(Problem("E-BLUETOOTH-ABSENT", f"module {address}", "it does not answer", fix))


def not_paired(address: str, error: BusError, pin_requested: bool) -> RunError:
    """Pairing failed; `pin_requested`: the service asked for the PIN, so the module is there."""
    name = error.name.rpartition(".")[2]
    timeouts = ("ConnectionAttemptFailed", "timeout", "AuthenticationTimeout")
    if name in timeouts and not pin_requested:
        return not_found(address)
    if name in ("AuthenticationFailed", "AuthenticationRejected"):
        cause = "the module does not accept this PIN"
        fix = (
            "most modules have 1234, some 0000: --pin 0000; if it was paired before, remove that "
            "pairing with --again"
        )
    else:
        cause = f"pairing failed: {error.text or name}"
        fix = "switch the module off and on and try again; if it was paired before, use --again"
    return RunError(Problem("E-BLUETOOTH-PAIR", f"module {address}", cause, fix))


def refused(error: BusError) -> RunError:
    name, code = error.name.rpartition(".")[2], "E-BLUETOOTH-SERVICE"
    if name in NO_SERVICE:
        cause, fix = "the system's Bluetooth service does not answer", START_FIX
    elif name == "AccessDenied":
        cause = "you have no permission to use the Bluetooth service"
        fix = "sudo usermod -aG bluetooth $USER, then log out and in again"
    elif name in ("NotReady", "Blocked") or "rfkill" in error.text.lower():
        code, cause = "E-BLUETOOTH-BLOCKED", "the radio is disabled"
        fix = "run rfkill unblock bluetooth; `diffbotctl doctor` shows the cause"
    else:
        cause = f"the service refuses the request: {error.text or name}"
        fix = "run sudo systemctl restart bluetooth, and try again"
    return RunError(Problem(code, PLACE, cause, fix))
