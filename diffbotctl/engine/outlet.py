"""The engine's end of a channel to a child process that must lose nothing."""

from __future__ import annotations

import pickle
import socket
import struct
from collections.abc import Callable
from typing import Any

BACKLOG = 16 << 20  # bytes that may wait for the child; then it is given up
LENGTH = struct.Struct("<I")


class Outlet:
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
