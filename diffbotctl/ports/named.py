"""A port that somebody named: there, gone, called something else by now, or no port at all."""

from __future__ import annotations

import os
from pathlib import Path

from diffbotctl.errors import Problem
from diffbotctl.ports import chips
from diffbotctl.ports.judge import Report, Survey, problem

PTY = "/dev/pts/"


def judge_name(root: Path, seen: Survey, name: str) -> Report | Problem | None:
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
    return problem("E-PORT-KIND", name, f"it is {what}", _instead(seen))


def _real(root: Path, name: str) -> str:
    """Where the name leads, links followed, as seen from inside the root."""
    path = name
    for _ in range(8):  # links to links; more is a ring
        inside = root / path.lstrip("/")
        if not inside.is_symlink():
            return path
        path = os.path.normpath(os.path.join(os.path.dirname(path), os.readlink(inside)))
    return path


def _vanished(seen: Survey, name: str) -> Problem:
    boards = [each for each in seen.reports if each.role in (chips.MEGA, chips.CHIP)]
    if len(boards) == 1 and _plugged(name):
        now = boards[0].port
        better = now.stable or now.device
        return problem("E-PORT-RENAMED", name, f"it is gone; the board is {now.device} now",
                       f"use --port {better}, a name that stays" if now.stable
                       else f"use --port {better}, or --port auto")  # fmt: skip
    if "rfcomm" in name:
        return problem("E-PORT-OPEN", name, "no Bluetooth module is bound to it",
                       "use --port bluetooth:ADDRESS, which needs no rfcomm; `diffbotctl "
                       "bluetooth scan` tells the address")  # fmt: skip
    return problem("E-PORT-OPEN", name, "there is no such port", _instead(seen))


def _plugged(name: str) -> bool:
    return any(part in name for part in ("ttyUSB", "ttyACM", "by-id", "by-path"))


def _instead(seen: Survey) -> str:
    names = [each.port.stable or each.port.device for each in seen.reports if each.usable]
    if names:
        return f"there is {', '.join(names)}"
    return "plug the board in; a charging cable has no data wires and shows nothing"
