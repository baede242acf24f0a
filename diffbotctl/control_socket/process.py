"""The hub's process: a child of the engine that holds the control socket, and the flight."""

from __future__ import annotations

import json
import os
import signal
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diffbotctl.control_socket.address import remove_socket
from diffbotctl.processes.child_process import close_inherited_files, fork

if TYPE_CHECKING:
    from diffbotctl.control_socket.run_state import RunInfo
    from diffbotctl.control_socket.server import Log, Server
    from diffbotctl.recording.black_box_store import BlackBoxStore

NICENESS = 5  # the control path goes first on a machine with one core
LAST_WORDS = 0.5  # s for clients to take what waits when the run is over
LOG_SIZE = 1 << 20  # bytes; then the log begins anew, and the one before it is kept
NEWS = 1 << 20  # bytes of socket buffer: seconds of news


def start(
    listener: socket.socket,
    path: Path,
    about: RunInfo,
    shared: bool,
    keeper: BlackBoxStore | None = None,
) -> tuple[socket.socket, int]:
    """Fork the hub, which serves `listener` at `path`. Returns the engine's end, and the pid.

    The flight recorder's `keeper` lives in it, if there is one.
    """
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, NEWS)

    def serve() -> int:
        from diffbotctl.control_socket.server import Server

        log = _log(path.with_suffix(".log"))
        log({"event": "started", "pid": about.pid, "engine": about.name})
        return _serve(Server(listener, theirs, about, shared, log, keeper), path, log)

    return ours, _fork({listener, theirs}, serve, keeper)


def keep(keeper: BlackBoxStore) -> int:
    """Fork a hub that only keeps the flight, for a run without a socket. Returns the pid."""
    return _fork(set(), lambda: 0, keeper)


def _fork(kept: set[socket.socket], serve: Callable[[], int], keeper: BlackBoxStore | None) -> int:
    """Fork a child that holds `kept` while it serves, and the flight until the engine has ended."""
    held = kept if keeper is None else kept | {keeper.channel}

    def live() -> int:
        close_inherited_files({each.fileno() for each in held}, NICENESS)
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # writers of flights end by themselves
        code = serve()
        if keeper is not None:  # also when the hub has failed, or the engine was killed
            close_inherited_files({keeper.fileno()}, 0)
            keeper.read_to_end()
        return code

    pid = fork(live)
    for each in held:
        each.close()
    return pid


def _serve(server: Server, path: Path, log: Log) -> int:
    try:
        server.run()
    except Exception:
        from traceback import format_exc

        log({"event": "failed", "traceback": format_exc()})
        return 1  # what stands beside the socket stays: `stop` finds the engine by it
    remove_socket(path)
    server.farewell(LAST_WORDS)
    return 0


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
