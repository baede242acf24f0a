"""Programs of the system that take a board's port away: brltty and ModemManager; login consoles."""

from __future__ import annotations

import re
from pathlib import Path

from diffbotctl.ports.port_users import programs
from diffbotctl.ports.sysfs import Usb, text

MODEM_MANAGER = "ModemManager"
RULES = ("etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")
CONSOLE = re.compile(r"\bconsole=(tty(?:AMA|S|USB|ACM)\d+|serial\d+)")


def brltty_wants(root: Path, usb: Usb) -> bool:
    """Whether brltty's udev rules claim this USB identity for a Braille display."""
    wanted = f"{usb.vendor:x}/{usb.product:x}/"
    return any(
        wanted in line.lower() for line in _brltty_rules(root) if not line.lstrip().startswith("#")
    )


def _brltty_rules(root: Path) -> list[str]:
    lines: list[str] = []
    seen = set()
    for folder in RULES:
        for file in sorted((root / folder).glob("*brltty*.rules")):
            if file.name not in seen:  # the first folder's file hides those of the others
                seen.add(file.name)
                lines += text(file).splitlines()
    return lines


def modem_manager(root: Path) -> bool:
    """Whether ModemManager runs."""
    return any(program.name == MODEM_MANAGER for program in programs(root))


def console(root: Path, device: str) -> bool:
    """Whether the kernel's console, and with it a login, is on this port."""
    for name in CONSOLE.findall(text(root / "proc/cmdline")):
        real = (root / "dev" / name).resolve().name
        if device == f"/dev/{real}":
            return True
    return False
