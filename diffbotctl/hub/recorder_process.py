"""The recorder: a child process that turns compact records into an MCAP file.

It outlives a killed engine just long enough to write what had reached it. When it cannot write, it
says so once, on the channel it reads from, and from then on only keeps the channel empty.
"""

from __future__ import annotations

import gc
import os
import pickle
import select
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from diffbotctl.engine.recorder import LENGTH

BUFFER = 4 << 20  # bytes of socket buffer: seconds of a fast run
FLUSH_PERIOD = 1.0  # s; what a power cut may cost


def start(
    path: Path, wires: dict[str, type], sources: int, about: dict[str, str]
) -> tuple[socket.socket, int]:
    """Open `path` and fork the recorder. Returns the engine's end of the channel, and the pid.

    Raises OSError when the file cannot be opened: in the engine, before anything has started.
    """
    file = open(path, "wb")  # noqa: SIM115 - the child closes it
    ours, theirs = socket.socketpair()
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
    gc.freeze()  # as for the hub: what is not walked stays shared
    pid = os.fork()
    if pid:
        file.close()
        theirs.close()
        return ours, pid
    ours.close()
    code = 1
    try:
        code = _record(theirs, file, wires, sources, about)
    finally:
        os._exit(code)


def _record(
    channel: socket.socket, file: Any, wires: dict[str, type], sources: int, about: dict[str, str]
) -> int:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the engine says when it is over
    signal.set_wakeup_fd(-1)
    try:
        _write_all(channel, file, wires, sources, about)
    except OSError as error:
        report(channel, f"{os.strerror(error.errno or 0)}")
        for _ in items(channel):
            pass
        return 1
    return 0


def _write_all(
    channel: socket.socket, file: Any, wires: dict[str, type], sources: int, about: dict[str, str]
) -> None:
    from diffbotctl.hub.recording import Recording

    recording = Recording(file, wires, sources, about)
    flushed = time.monotonic()
    summary: dict[str, str] | None = None
    for item in items(channel):
        if isinstance(item, list):
            for instant in item:
                recording.write(instant)
        elif isinstance(item, dict):
            summary = item
        if time.monotonic() - flushed >= FLUSH_PERIOD:
            recording.flush()
            flushed = time.monotonic()
    recording.flush()
    if summary is not None:
        recording.finish({**summary, "instants": str(recording.instants)})


def items(channel: socket.socket) -> Iterator[Any]:
    """Everything that comes over the channel, and None each second of silence, until its end."""
    buffer = bytearray()
    while True:
        if not select.select([channel], [], [], FLUSH_PERIOD)[0]:
            yield None
            continue
        try:
            data = channel.recv(1 << 16)
        except ConnectionResetError:
            return
        if not data:
            return
        buffer += data
        while len(buffer) >= LENGTH.size:
            (length,) = LENGTH.unpack_from(buffer)
            if len(buffer) < LENGTH.size + length:
                break
            yield pickle.loads(buffer[LENGTH.size : LENGTH.size + length])
            del buffer[: LENGTH.size + length]


def report(channel: socket.socket, trouble: str) -> None:
    """Tell the engine why nothing is written any longer."""
    with suppress(OSError):
        channel.send(trouble.encode())
