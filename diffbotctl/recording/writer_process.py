"""The recorder: a child process that turns compact records into an MCAP file.

It outlives a killed engine just long enough to write what had reached it. When it cannot write, it
says so once, on the channel it reads from, and from then on only keeps the channel empty.
"""

from __future__ import annotations

import os
import pickle
import select
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from diffbotctl.processes.fork import fork_with_channel
from diffbotctl.recording.foxglove import SensorMount
from diffbotctl.recording.recorder import LENGTH

FLUSH_PERIOD = 0.7  # s; with what the engine gathers, a power cut costs less than a second


def start_recorder(
    path: Path,
    wires: dict[str, type],
    sources: int,
    about: dict[str, str],
    mounts: dict[str, SensorMount] | None = None,
) -> tuple[socket.socket, int]:
    """Open `path` and fork the recorder. Returns the engine's end of the channel, and the pid.

    `wires` are all wires, the `sources` of the drivers first; `mounts` says where sensors sit, by
    the wire of their range. Raises OSError when the file cannot be opened: in the engine, before
    anything has started.
    """
    file = open(path, "wb")  # noqa: SIM115 - the child closes it
    channel, pid = fork_with_channel(
        lambda ours: _record(ours, file, (wires, sources, about, mounts or {}))
    )
    file.close()
    return channel, pid


Subject = tuple[dict[str, type], int, dict[str, str], dict[str, SensorMount]]


def _record(channel: socket.socket, file: Any, subject: Subject) -> int:
    try:
        _write_all(channel, file, subject)
    except OSError as error:
        report(channel, f"{os.strerror(error.errno or 0)}")
        for _ in read_items(channel):
            pass
        return 1
    return 0


def _write_all(channel: socket.socket, file: Any, subject: Subject) -> None:
    from diffbotctl.recording.mcap_file import Recording

    recording = Recording(file, *subject)
    flushed = time.monotonic()
    summary: dict[str, str] | None = None
    for item in read_items(channel):
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


def read_items(channel: socket.socket) -> Iterator[Any]:
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
        yield from map(pickle.loads, split_frames(buffer))


def split_frames(buffer: bytearray) -> Iterator[bytes]:
    """Take the items that are complete off the front of `buffer`; they are still pickled."""
    while len(buffer) >= LENGTH.size:
        (length,) = LENGTH.unpack_from(buffer)
        if len(buffer) < LENGTH.size + length:
            return
        yield bytes(buffer[LENGTH.size : LENGTH.size + length])
        del buffer[: LENGTH.size + length]


def report(channel: socket.socket, trouble: str) -> None:
    """Say something to the engine; one that has gone does not hear it."""
    with suppress(OSError):
        channel.send(trouble.encode())
