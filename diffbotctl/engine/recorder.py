"""The engine's end of a recording, or of a log's file: compact records, handed on without waiting.

The other end lives in a child process. Nothing here formats text or touches a disk.
"""

from __future__ import annotations

import pickle
import socket
import struct
from collections.abc import Callable
from typing import Any

BATCH = 256  # instants an unpaced run gathers before it hands them on
BACKLOG = 16 << 20  # bytes that may wait for the child; then the recording is given up
LENGTH = struct.Struct("<I")


class Recorder:
    """Gathers instants, or lines, and sends them as length-prefixed pickles of lists of tuples.

    `waits`: an unpaced run waits for the child; a paced one never does, and on overflow the
    recording is given up while the run goes on. `tell` is called once, with the reason, when the
    recording has become incomplete.
    """

    def __init__(self, channel: socket.socket, waits: bool, tell: Callable[[str], None]) -> None:
        self.channel = channel
        self.waits = waits
        self.tell = tell
        self.pending: list[tuple[Any, ...]] = []
        self.backlog = bytearray()
        self.record: Callable[[tuple[Any, ...]], object] = self.pending.append
        self.lost: str | None = None
        channel.setblocking(waits)

    def drain(self) -> None:
        """Hand on what has gathered. Called in the loop's idle time, after commands have left."""
        if not self.pending or (self.waits and len(self.pending) < BATCH):
            return
        self._send(self.pending)
        self.pending.clear()
        self._listen()

    def close(self, summary: dict[str, str] | None = None) -> None:
        """Hand on the rest, waiting for the child; then say that this was all.

        Without loss a recording ends complete, with `summary` in it.
        """
        self.channel.setblocking(True)
        self._listen()
        self._send(self.pending)
        if self.lost is None and summary is not None:
            self._send(summary)
        self.channel.shutdown(socket.SHUT_WR)
        if self.lost is None:
            said = self.channel.recv(1 << 10)  # nothing but the end when all was written
            if said:
                self._give_up(said.decode())
        self.channel.close()

    def _send(self, item: Any) -> None:
        if self.lost is not None:
            return
        body = pickle.dumps(item, pickle.HIGHEST_PROTOCOL)
        self.backlog += LENGTH.pack(len(body)) + body
        try:
            while self.backlog:
                del self.backlog[: self.channel.send(self.backlog)]
        except BlockingIOError:
            if len(self.backlog) > BACKLOG:
                self._give_up("its writer could not keep up")
        except (BrokenPipeError, ConnectionResetError):
            self._give_up("its writer has ended")

    def _listen(self) -> None:
        """Hear whether the child is in trouble."""
        if self.lost is not None:
            return
        try:
            said = self.channel.recv(1 << 10, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except ConnectionResetError:
            said = b""
        self._give_up(said.decode() or "its writer has ended")

    def _give_up(self, cause: str) -> None:
        self.lost = cause
        self.backlog.clear()
        self.tell(cause)
