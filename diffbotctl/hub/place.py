"""Where an engine's control socket lies: one folder a user, or one a group under /run.

Beside the socket NAME.socket stands NAME.engine with the engine's process, for the day when the
socket no longer answers.
"""

from __future__ import annotations

import json
import os
import socket
from pathlib import Path
from typing import NamedTuple

RUN = Path("/run")
PREFIX = "diffbotctl"


class Process(NamedTuple):
    """A process, told from a later one of the same number by its start time in clock ticks."""

    pid: int
    started: int

    @property
    def is_alive(self) -> bool:
        """True while that very process exists and is no zombie."""
        return started(self.pid) == self.started


class Engine(NamedTuple):
    """A running engine as the file system shows it."""

    name: str
    socket: Path
    process: Process | None


def own_folder() -> Path:
    """The folder of this user's sockets: only the user may enter it."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    if runtime and Path(runtime).is_dir():
        return Path(runtime) / PREFIX
    return Path("/tmp") / f"{PREFIX}-{os.getuid()}"


def group_folder(group: str) -> Path:
    """The folder of the sockets that the members of `group` may use."""
    return RUN / f"{PREFIX}-{group}"


def started(pid: int) -> int | None:
    """When `pid` was started, in clock ticks since boot; None when it is gone or a zombie."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()  # the name before it may hold anything
    return None if fields[0] in "ZX" else int(fields[19])


def engines() -> list[Engine]:
    """Every engine that this user may speak to, and whose process or socket is alive."""
    found = []
    for folder in _folders():
        for path in sorted(folder.glob("*.socket")):
            engine = Engine(path.stem, path, process_of(path))
            if engine.process.is_alive if engine.process else answers(path):
                found.append(engine)
    return found


def answers(path: Path) -> bool:
    """True when something listens at the socket `path`; a stale socket refuses the connection."""
    with socket.socket(socket.AF_UNIX) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except BlockingIOError:
            return True  # its queue is full: it lives, and is busy
        except OSError:
            return False
    return True


def _folders() -> list[Path]:
    shared = [
        path for path in sorted(RUN.glob(f"{PREFIX}-*")) if os.access(path, os.R_OK | os.X_OK)
    ]
    return [own_folder(), *shared]


def process_of(path: Path) -> Process | None:
    try:
        said = json.loads(path.with_suffix(".engine").read_text())
        return Process(int(said["pid"]), int(said["started"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None
