"""The engine's end of a channel to a child process that must lose nothing.

The engine's end of a recording, or of a log's file: compact records, handed on without waiting.

The other end lives in a child process. Nothing here formats text or touches a disk.
"""

from __future__ import annotations

import pickle
import socket
import struct
from collections.abc import Callable
from typing import Any

BACKLOG = 16 << 20  # bytes that may wait for the child; then it is given up
LENGTH = struct.Struct("<I")


class ChildSender:
    """Sends length-prefixed pickles, and hears what the child says.

    `waits`: sending waits for the child; else what does not fit waits here, up to BACKLOG. `tell`
    is called once, with the reason, when something was lost; from then on nothing is sent.
    """

    def __init__(self, channel: socket.socket, waits: bool, tell: Callable[[str], None]) -> None:
        self.channel = channel
        self.tell = tell
        self.backlog = bytearray()
        self.lost: str | None = None
        channel.setblocking(waits)

    def send(self, item: Any) -> None:
        """Send `item` as far as it goes."""
        if self.lost is not None:
            return
        body = pickle.dumps(item, pickle.HIGHEST_PROTOCOL)
        self.backlog += LENGTH.pack(len(body)) + body
        try:
            while self.backlog:
                del self.backlog[: self.channel.send(self.backlog)]
        except BlockingIOError:
            if len(self.backlog) > BACKLOG:
                self.give_up("the recorder could not keep up")
        except TimeoutError:
            self.give_up("the recorder does not answer")
        except (BrokenPipeError, ConnectionResetError):
            self.give_up("the recorder has ended")

    def hear(self) -> str | None:
        """What the child has said since; None when it said nothing. Its end is a loss."""
        if self.lost is not None:
            return None
        try:
            said = self._receive(socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None
        if not said and self.lost is None:
            self.give_up("the recorder has ended")
        return said.decode() or None

    def finish(self) -> None:
        """Say that this was all."""
        self.channel.shutdown(socket.SHUT_WR)

    def close(self) -> str:
        """Wait until the child has nothing more to say; return its last words."""
        said = b""
        self.channel.setblocking(True)
        while self.lost is None and (part := self._receive()):
            said += part
        self.channel.close()
        return said.decode()

    def _receive(self, flags: int = 0) -> bytes:
        """What comes; a child that died with something unread has lost it."""
        try:
            return self.channel.recv(1 << 10, flags)
        except ConnectionResetError:
            self.give_up("the recorder has ended")
            return b""

    def give_up(self, cause: str) -> None:
        """Note that something was lost."""
        self.lost = cause
        self.backlog.clear()
        self.tell(cause)


BATCH = 256  # instants an unpaced run gathers before it hands them on
GATHERED = 100_000_000  # ns that a paced run gathers: waking the child costs more than what it does


class Recorder:
    """Gathers instants, or lines, and sends them as lists of tuples.

    `waits`: an unpaced run waits for the child; a paced one never does, and on overflow the
    recording is given up while the run goes on. `tell` is called once, with the reason, when the
    recording has become incomplete. `at_once`: what a person follows is not gathered.
    """

    def __init__(
        self,
        channel: socket.socket,
        waits: bool,
        tell: Callable[[str], None],
        at_once: bool = False,
    ) -> None:
        self.outlet = ChildSender(channel, waits, tell)
        self.waits = waits
        self.at_once = at_once and not waits
        self.pending: list[tuple[Any, ...]] = []
        self.record: Callable[[tuple[Any, ...]], object] = self.pending.append

    @property
    def lost(self) -> str | None:
        """Why the recording is incomplete; None while it is not."""
        return self.outlet.lost

    def drain(self) -> None:
        """Hand on what has gathered. Called in the loop's idle time, after commands have left."""
        pending = self.pending
        if not pending or not (self.at_once or self._is_enough(pending)):
            return
        self.outlet.send(self.pending)
        self.pending.clear()
        self._listen()

    def _is_enough(self, pending: list[tuple[Any, ...]]) -> bool:
        return len(pending) >= BATCH or (not self.waits and drain_batch(pending))

    def close(self, summary: dict[str, str] | None = None) -> None:
        """Hand on the rest, waiting for the child; then say that this was all.

        Without loss a recording ends complete, with `summary` in it.
        """
        self.outlet.channel.setblocking(True)
        self._listen()
        self.outlet.send(self.pending)
        if summary is not None:
            self.outlet.send(summary)
        self.outlet.finish()
        trouble = self.outlet.close()
        if trouble:
            self.outlet.give_up(trouble)

    def _listen(self) -> None:
        """Hear whether the child is in trouble: it speaks of nothing else."""
        trouble = self.outlet.hear()
        if trouble is not None:
            self.outlet.give_up(trouble)


def drain_batch(instants: list[tuple[Any, ...]]) -> bool:
    """Whether they are worth waking a child for."""
    return bool(instants[-1][0] - instants[0][0] >= GATHERED)
