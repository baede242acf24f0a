"""What a run must not leave behind: processes, and sockets in its runtime folder."""

from __future__ import annotations

import os
import time
from pathlib import Path

LINGER_S = 10.0  # for children of a killed engine, on a busy machine
POLL_PERIOD_S = 0.02


def leftovers(folder: Path) -> list[str]:
    """What is left of runs whose XDG_RUNTIME_DIR was `folder`, and that have ended.

    Processes are waited for, LINGER_S at most.
    """
    deadline = time.monotonic() + LINGER_S
    while (pids := processes_of(folder)) and time.monotonic() < deadline:
        time.sleep(POLL_PERIOD_S)
    sockets = sorted(path.name for path in folder.glob("diffbotctl/*.socket"))
    return [
        *(f"process {pid} is left" for pid in pids),
        *(f"socket {name} is left" for name in sockets),
    ]


def processes_of(folder: Path) -> list[int]:
    """The living processes whose XDG_RUNTIME_DIR is `folder`."""
    variable = f"XDG_RUNTIME_DIR={folder}".encode()
    return [
        int(name)
        for name in os.listdir("/proc")
        if name.isdecimal() and variable in _environment(name).split(b"\0")
    ]


def _environment(pid: str) -> bytes:
    try:
        return Path(f"/proc/{pid}/environ").read_bytes()
    except OSError:
        return b""
