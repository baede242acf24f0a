"""The server process: a child of the engine that holds the control socket and the black box."""

from __future__ import annotations

import io
import json
import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stderr, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diffbotctl.control_socket.address import remove_socket
from diffbotctl.processes.child_process import close_inherited_files, fork

if TYPE_CHECKING:
    from diffbotctl.control_socket.dispatch import AccessLog
    from diffbotctl.control_socket.run_state import RunInfo
    from diffbotctl.control_socket.server import Server
    from diffbotctl.recording.black_box_store import BlackBoxStore

NICENESS = 5  # the control path has priority on a machine with one core
FINISH_TIMEOUT_S = 0.5  # for clients to read the rest when the run has ended
LOG_MAX_BYTES = 1 << 20  # then a new log begins, and the one before it is kept
UPDATE_BUFFER_BYTES = 1 << 20  # of the socket: seconds of updates


def start_server(
    listener: socket.socket,
    path: Path,
    info: RunInfo,
    shared: bool,
    store: BlackBoxStore | None = None,
) -> tuple[socket.socket, int]:
    """Fork the server of `listener` at `path`. Returns the engine's end of its channel and the pid.

    The `store` of the black box, if there is one, lives in it.
    """
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UPDATE_BUFFER_BYTES)

    def serve() -> int:
        from diffbotctl.control_socket.server import Server  # the engine does not need it

        log = _access_log(path.with_suffix(".log"))
        log({"event": "started", "pid": info.pid, "engine": info.name})
        return _serve(Server(listener, theirs, info, shared, log, store), path, log)

    return ours, _fork({listener, theirs}, serve, store)


def start_black_box_process(store: BlackBoxStore) -> int:
    """Fork a process with the black box alone, for a run without a socket. Returns the pid."""
    return _fork(set(), lambda: 0, store)


def _fork(files: set[socket.socket], serve: Callable[[], int], store: BlackBoxStore | None) -> int:
    """Fork a child that keeps `files` while it serves, and the black box until the engine ends."""
    kept = files if store is None else files | {store.channel}

    def run() -> int:
        close_inherited_files({file.fileno() for file in kept}, NICENESS)
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # processes that write files end on their own
        code = serve()
        if store is not None:  # also when the server has failed, or the engine was killed
            close_inherited_files({store.fileno()}, 0)
            store.read_to_end()
        return code

    pid = fork(run)
    for file in kept:
        file.close()
    return pid


def _serve(server: Server, path: Path, log: AccessLog) -> int:
    try:
        server.run()
    except Exception as error:
        text = io.StringIO()
        with redirect_stderr(text):  # without the module `traceback`, which takes 150 kB
            sys.__excepthook__(type(error), error, error.__traceback__)
        log({"event": "failed", "traceback": text.getvalue()})
        return 1  # the file beside the socket stays: `stop` needs it to find the engine
    remove_socket(path)
    server.finish(FINISH_TIMEOUT_S)
    return 0


def _access_log(path: Path) -> AccessLog:
    """A log of who commanded what: one JSON object a line, at most twice LOG_MAX_BYTES."""

    def write(event: dict[str, Any]) -> None:
        text = json.dumps({"at": time.time(), **event}) + "\n"
        with suppress(OSError):  # a full disk must not keep anyone from stopping the robot
            if path.exists() and path.stat().st_size > LOG_MAX_BYTES:
                path.replace(path.with_suffix(".log.1"))
            with open(path, "a", opener=_open_private) as file:
                file.write(text)

    return write


def _open_private(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW, 0o600)
