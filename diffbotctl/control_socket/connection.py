"""How often something may be done: so many at once, and so many a second in the long run.

One connection to the control socket: lines in, a bounded queue of lines out.
"""

from __future__ import annotations

import socket
import struct
from collections import deque
from typing import NamedTuple

from diffbotctl.control_socket.protocol import LineBuffer, encode_line


class TokenBucket:
    """A purse that fills with `rate` coins a second up to `most`."""

    def __init__(self, rate: float, most: float, now: float) -> None:
        self.rate = rate
        self.most = most
        self.saved = most
        self.at = now

    def allows(self, now: float) -> bool:
        """True when one may be done at `now` (s)."""
        self.saved = min(self.saved + (now - self.at) * self.rate, self.most)
        self.at = now
        return self.saved >= 1.0

    def spend(self) -> None:
        """One was done."""
        self.saved -= 1.0


MOST_STREAMED = 500  # lines that wait for a client which reads slowly; the oldest goes first
MOST_ANSWERS = 50  # answers that wait; then nothing more is read from that client
CREDENTIALS = struct.Struct("3i")
READ = 1 << 16  # bytes at once
REQUESTS_PER_SECOND = 200.0
MOST_AT_ONCE = 100.0  # requests that a client may send in one burst


class Peer(NamedTuple):
    """Who is at the other end, as the kernel says."""

    pid: int
    uid: int
    gid: int


def peer_of(connection: socket.socket) -> Peer:
    """The process that connected."""
    data = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
    return Peer(*CREDENTIALS.unpack(data))


class Client:
    """A connection with its queue. `name` is empty before its hello."""

    def __init__(self, connection: socket.socket, number: int, peer: Peer, now: float) -> None:
        self.connection = connection
        self.number = number
        self.peer = peer
        self.name = ""
        self.since = now
        self.lines = LineBuffer()
        self.watched: set[str] = set()
        self.answers: deque[bytes] = deque()
        self.stream: deque[bytes] = deque(maxlen=MOST_STREAMED)
        self.lost = 0
        self.sending = b""
        self.hears = True  # False once the other end sends no more
        self.ending = False  # True: closed when what waits is sent
        self.expected = 0  # commands that the engine has not answered yet
        self.drives = False  # True once it has driven: its leaving matters
        self.pace = TokenBucket(REQUESTS_PER_SECOND, MOST_AT_ONCE, now)
        connection.setblocking(False)

    @property
    def who(self) -> str:
        """The client as a stop's cause names it."""
        return f"{self.name or 'a client'} (process {self.peer.pid}, uid {self.peer.uid})"

    def answer(self, fields: dict[str, object]) -> None:
        """Queue an answer; these are never dropped."""
        self.answers.append(encode_line(fields))

    def push(self, data: bytes) -> None:
        """Queue a line of a stream; the oldest is dropped and counted when there are too many."""
        if len(self.stream) == MOST_STREAMED:
            self.lost += 1
        self.stream.append(data)

    def read(self) -> bool:
        """Take what has come. False when the other end will send no more."""
        try:
            data = self.connection.recv(READ)
        except BlockingIOError:
            return True
        except OSError:
            return False
        self.lines.add(data)
        return bool(data)

    def next_line(self, now: float) -> bytes | None:
        """The next whole line, unless this client asks too often. Raises RefusalError."""
        if not self.pace.allows(now) or len(self.answers) >= MOST_ANSWERS:
            return None
        found = self.lines.next()
        if found is not None:
            self.pace.spend()
        return found

    @property
    def is_paused(self) -> bool:
        """True when requests of it wait, so that no more need be read."""
        return b"\n" in self.lines.rest

    def write(self) -> bool:
        """Send what fits. False when the other end is gone."""
        try:
            while self._load():
                sent = self.connection.send(self.sending, socket.MSG_NOSIGNAL)
                self.sending = self.sending[sent:]
        except BlockingIOError:
            return True
        except OSError:
            return False
        return True

    @property
    def waits(self) -> bool:
        """True when something waits to be sent."""
        return bool(self.sending or self.answers or self.stream)

    @property
    def is_done(self) -> bool:
        """True when all is said on both sides."""
        if self.waits or self.expected or (self.is_paused and not self.ending):
            return False
        return self.ending or not (self.hears or self.watched)

    def _load(self) -> bool:
        """Have something in `sending`: answers first, then the loss, then the stream."""
        if not self.sending:
            if self.answers:
                self.sending = self.answers.popleft()
            elif self.lost:
                self.sending, self.lost = encode_line({"lost": self.lost}), 0
            elif self.stream:
                self.sending = self.stream.popleft()
        return bool(self.sending)
