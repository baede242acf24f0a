"""The hub's process: a child of the engine that holds the control socket and nothing else."""

from __future__ import annotations

import gc
import json
import os
import signal
import socket
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from diffbotctl.hub.conversation import Log
from diffbotctl.hub.desk import About
from diffbotctl.hub.listening import forget
from diffbotctl.hub.server import Server

NICENESS = 5  # the control path goes first on a machine with one core
LAST_WORDS = 0.5  # s for clients to take what waits when the run is over
LOG_SIZE = 1 << 20  # bytes; then the log begins anew, and the one before it is kept
NEWS = 1 << 20  # bytes of socket buffer: seconds of news


def start(
    listener: socket.socket, path: Path, about: About, shared: bool
) -> tuple[socket.socket, int]:
    """Fork the hub, which serves `listener` at `path`. Returns the engine's end, and the pid."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, NEWS)
    gc.freeze()  # a collection that walks what both share would make each a copy of its own
    pid = os.fork()
    if pid:
        theirs.close()
        listener.close()
        return ours, pid
    try:
        _stand_alone({listener.fileno(), theirs.fileno()})
        log = _log(path.with_suffix(".log"))
        log({"event": "started", "pid": about.pid, "engine": about.name})
        _serve(Server(listener, theirs, about, shared, log), path, log)
    finally:
        os._exit(0)


def _serve(server: Server, path: Path, log: Log) -> None:
    try:
        server.run()
    except Exception:
        from traceback import format_exc

        log({"event": "failed", "traceback": format_exc()})
        return  # what stands beside the socket stays: `stop` finds the engine by it
    forget(path)
    server.farewell(LAST_WORDS)


def _stand_alone(kept: set[int]) -> None:
    """Let go of all that belongs to the engine, so that its end shows to whoever waits for it."""
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the engine says when it is over
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
