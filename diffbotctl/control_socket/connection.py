"""One connection to the control socket: lines in, bounded queues of lines out, subscriptions."""

from __future__ import annotations

import select
import socket
import struct
import time
from collections import deque
from collections.abc import Iterable
from typing import Any, NamedTuple

from diffbotctl.control_socket.protocol import Fields, LineBuffer, encode_line
from diffbotctl.recording.json_codec import message_encoder

STREAM_LINES_MAX = 500  # that wait for a client which reads slowly; the oldest is dropped first
REPLIES_MAX = 50  # that wait; then nothing more is read from that client
CREDENTIALS = struct.Struct("3i")
READ_BYTES = 1 << 16  # at once
SEND_BYTES = 1 << 12  # after which no further line is sent in the same piece
REQUESTS_PER_SECOND = 300.0
REQUEST_BURST = 100.0
HELLO_TIMEOUT_S = 10.0
UNREAD_TIMEOUT_S = 5.0  # that a client with REPLIES_MAX waiting may read nothing


class TokenBucket:
    """Limits a rate: a token is added `rate` times a second, up to `capacity`."""

    def __init__(self, rate: float, capacity: float, now: float) -> None:
        self.rate = rate
        self.capacity = capacity
        self.tokens = capacity
        self.updated = now

    def allows(self, now: float) -> bool:
        """Whether there is a token at `now` (s)."""
        self.tokens = min(self.tokens + (now - self.updated) * self.rate, self.capacity)
        self.updated = now
        return self.tokens >= 1.0

    def spend(self) -> None:
        self.tokens -= 1.0


class Peer(NamedTuple):
    """The process at the other end, as the kernel reports it."""

    pid: int
    uid: int
    gid: int


def peer_of(connection: socket.socket) -> Peer:
    data = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
    return Peer(*CREDENTIALS.unpack(data))


class Client:
    """A connection with its queues. `name` is empty before its hello."""

    def __init__(self, connection: socket.socket, number: int, peer: Peer, now: float) -> None:
        self.connection = connection
        self.number = number
        self.peer = peer
        self.name = ""
        self.connected_at = now
        self.sent_at = now  # when it last took something, or nothing waited
        self.lines = LineBuffer()
        self.topics: set[str] = set()  # subscribed
        self.replies: deque[bytes] = deque()
        self.stream: deque[bytes] = deque(maxlen=STREAM_LINES_MAX)
        self.lost = 0
        self.sending = b""
        self.events = int(select.EPOLLIN)  # that are waited for
        self.is_readable = True  # False once the other end sends no more
        self.is_for_stop = False  # beyond CLIENTS_MAX: it may only stop the robot
        self.is_closing = False  # closed when what waits is sent
        self.unanswered = 0  # commands without the engine's answer
        self.has_driven = False  # or published: the engine must know when it disconnects
        self.bucket = TokenBucket(REQUESTS_PER_SECOND, REQUEST_BURST, now)
        connection.setblocking(False)

    def is_late(self, now: float) -> bool:
        return not self.name and now - self.connected_at > HELLO_TIMEOUT_S

    def reads_nothing(self, now: float) -> bool:
        """Whether it asks on and on, and has read no reply for UNREAD_TIMEOUT_S."""
        if len(self.replies) < REPLIES_MAX:
            self.sent_at = now
        return now - self.sent_at > UNREAD_TIMEOUT_S

    @property
    def who(self) -> str:
        """The client as the cause of a stop names it; a command of ours as one is written."""
        name = f"`{self.name}`" if self.name.startswith("diffbotctl ") else self.name
        return f"{name or 'a client'} (process {self.peer.pid}, uid {self.peer.uid})"

    def answer(self, fields: Fields) -> None:
        """Queue a reply; these are never dropped."""
        self.replies.append(encode_line(fields))

    def push(self, data: bytes) -> None:
        """Queue a line of a stream; the oldest is dropped and counted when there are too many."""
        if len(self.stream) == STREAM_LINES_MAX:
            self.lost += 1
        self.stream.append(data)

    def read(self) -> bool:
        """Read what has come. False when the other end sends no more."""
        try:
            data = self.connection.recv(READ_BYTES)
        except BlockingIOError:
            return True
        except OSError:
            return False
        self.lines.add(data)
        return bool(data)

    def next_line(self, now: float) -> bytes | None:
        """The next complete line, unless this client asks too often. Raises RefusalError."""
        if not self.bucket.allows(now) or len(self.replies) >= REPLIES_MAX:
            return None
        line = self.lines.next()
        if line is not None:
            self.bucket.spend()
        return line

    @property
    def is_paused(self) -> bool:
        """Whether it has requests waiting, so that no more need be read."""
        return b"\n" in self.lines.rest

    @property
    def is_urgent(self) -> bool:
        """Whether it has not greeted yet, or may ask for a stop."""
        return not self.name or b'"stop"' in self.lines.rest

    def write(self) -> bool:
        """Send what fits. False when the other end is gone."""
        try:
            while self._load():
                sent = self.connection.send(self.sending, socket.MSG_NOSIGNAL)
                self.sending = self.sending[sent:]
                self.sent_at = time.monotonic()
        except BlockingIOError:
            return True
        except OSError:
            return False
        return True

    @property
    def waits(self) -> bool:
        """Whether something waits to be sent."""
        return bool(self.sending or self.replies or self.stream)

    @property
    def is_done(self) -> bool:
        if self.waits or self.unanswered or (self.is_paused and not self.is_closing):
            return False
        return self.is_closing or not (self.is_readable or self.topics)

    def _load(self) -> bool:
        """Fill `sending`: replies first, then the number of lost lines, then the stream.

        Several lines go together: each call of the system wakes the client.
        """
        if self.sending:
            return True
        lines = []
        size = 0
        while self.replies and size < SEND_BYTES:
            lines.append(self.replies.popleft())
            size += len(lines[-1])
        if not self.replies and self.lost:
            lines.append(encode_line({"lost": self.lost}))
            self.lost = 0
        while not self.replies and self.stream and size < SEND_BYTES:
            lines.append(self.stream.popleft())
            size += len(lines[-1])
        self.sending = b"".join(lines)
        return bool(self.sending)


class Subscriptions:
    """Encodes messages as lines, each once, for the clients that subscribe to their topic."""

    def __init__(self, wires: dict[str, type]) -> None:
        self.wires = wires
        self.encoders = {wire: message_encoder(kind) for wire, kind in wires.items()}

    def distribute(
        self, instants: Iterable[tuple[Any, ...]], lost: int, clients: Iterable[Client]
    ) -> None:
        """Queue the messages of `instants` for the subscribers, and count `lost` ones."""
        topics = {client: client.topics for client in clients}
        subscribed: set[str] = set().union(*topics.values())
        for instant in instants:
            for wire, message in zip(self.wires, instant[1:], strict=True):
                if message is not None and wire in subscribed:
                    data = self.line(wire, message)
                    for client, wires in topics.items():
                        if wire in wires:
                            client.push(data)
        for client in topics:
            client.lost += lost

    def line(self, wire: str, message: Any) -> bytes:
        return b'{"topic": "%s", "message": %s}\n' % (wire.encode(), self.encoders[wire](message))
