"""The hub's process: a child of the engine that holds the control socket and nothing else."""

from __future__ import annotations

import json
import os
import socket
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from diffbotctl.hub.conversation import Log
from diffbotctl.hub.desk import About
from diffbotctl.hub.listening import forget
from diffbotctl.hub.recorder_process import fork
from diffbotctl.hub.server import Server

NICENESS = 5  # the control path goes first on a machine with one core
LAST_WORDS = 0.5  # s for clients to take what waits when the run is over
LOG_SIZE = 1 << 20  # bytes; then the log begins anew, and the one before it is kept
NEWS = 1 << 20  # bytes of socket buffer: seconds of news


def start(
    listener: socket.socket, path: Path, about: About, shared: bool
) -> tuple[socket.socket, int]:
    """Fork the hub, which serves `listener` at `path`. Returns the engine's end, and the pid."""

    def serve(channel: socket.socket) -> int:
        _stand_alone({listener.fileno(), channel.fileno()})
        log = _log(path.with_suffix(".log"))
        log({"event": "started", "pid": about.pid, "engine": about.name})
        return _serve(Server(listener, channel, about, shared, log), path, log)

    channel, pid = fork(serve, packets=True, buffer=NEWS)
    listener.close()
    return channel, pid


def _serve(server: Server, path: Path, log: Log) -> int:
    try:
        server.run()
    except Exception:
        from traceback import format_exc

        log({"event": "failed", "traceback": format_exc()})
        return 1  # what stands beside the socket stays: `stop` finds the engine by it
    forget(path)
    server.farewell(LAST_WORDS)
    return 0


def _stand_alone(kept: set[int]) -> None:
    """Let go of all that belongs to the engine, so that its end shows to whoever waits for it."""
    nowhere = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    for name in os.listdir("/proc/self/fd"):
        file = int(name)
        if file > 2 and file not in kept | {nowhere}:
            with suppress(OSError):  # not closed: objects that still name it must hit nothing else
                os.dup2(nowhere, file, inheritable=False)
    with suppress(OSError):
        os.nice(NICENESS)


def _log(path: Path) -> Log:
    """A log of who did what: one JSON object a line, at most twice LOG_SIZE on the disk."""

    def write(event: dict[str, Any]) -> None:
        text = json.dumps({"at": time.time(), **event}) + "\n"
        with suppress(OSError):  # a full disk must not keep anyone from stopping the robot
            if path.exists() and path.stat().st_size > LOG_SIZE:
                path.replace(path.with_suffix(".log.1"))
            with open(path, "a", opener=_private) as file:
                file.write(text)

    return write


def _private(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW, 0o600)
