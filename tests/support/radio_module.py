"""A radio module between a board's serial port and a host's socket: late, lossy, sometimes away.

It stands for an HC-05 seen through an RFCOMM socket. What the board's UART sends is passed on 10 to
50 ms later, in order; now and then a frame is lost; in an outage nothing passes, and of what either
side sends meanwhile the module keeps what its buffer holds and delivers it afterwards, for a radio
delivers late rather than never.
"""

import heapq
import os
import select
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import NamedTuple

from tests.support.background import BackgroundDevice
from tests.support.serial_wire import read_available

BUFFER = 1024  # bytes that the module keeps of each direction; it has no flow control
TIMEOUT_S = 60.0  # of what the module's thread does at once
POLL_PERIOD_S = 0.002  # s between two looks at both ends
END = b"\0"  # of a frame


class DeliveredFrame(NamedTuple):
    """A frame that was delivered."""

    at: float  # s, time.monotonic
    to_host: bool
    data: bytes


class RadioDirection:
    """One direction: what is on its way, in order."""

    def __init__(self, rng: Random, delay: tuple[float, float], loss: float) -> None:
        self.rng, self.delay, self.loss = rng, delay, loss
        self.part = b""
        self.queue: list[tuple[float, int, bytes]] = []  # (due, number, frame)
        self.last = 0.0
        self.count = self.lost = 0

    def take(self, now: float, data: bytes, full: Callable[[int], bool]) -> None:
        """Bytes have come; `full`: nothing more fits while the radio is away."""
        *whole, self.part = (self.part + data).split(END)
        if whole:
            due = max(self.last, now + self.rng.uniform(*self.delay))
        for frame in whole:
            if not frame:
                continue
            self.count += 1
            if full(self.size) or self.rng.random() < self.loss:
                self.lost += 1
                continue
            self.last = due
            heapq.heappush(self.queue, (due, self.count, frame + END))

    @property
    def size(self) -> int:
        """Bytes on their way."""
        return sum(len(frame) for _, _, frame in self.queue)

    def due(self, now: float) -> Iterator[bytes]:
        """What is to be delivered."""
        while self.queue and self.queue[0][0] <= now:
            yield heapq.heappop(self.queue)[2]


class RadioModule(BackgroundDevice):
    """`device` is its name for --port. Listens until closed."""

    def __init__(
        self,
        port: str,
        path: Path | str,
        seed: int = 1,
        delay: tuple[float, float] = (0.010, 0.050),
        loss: float = 0.01,
    ) -> None:
        rng = Random(seed)
        self.device = f"socket:{path}"
        self.board = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.board)
        self.server = socket.socket(socket.AF_UNIX)
        self.server.bind(str(path))
        self.server.listen(1)
        self.server.setblocking(False)
        self.host: socket.socket | None = None
        self.up, self.down = (RadioDirection(rng, delay, loss) for _ in range(2))
        self.away_until = 0.0
        self.refusing = False
        self.broken = threading.Event()
        self.passed: list[DeliveredFrame] = []
        self.outages: list[tuple[float, float]] = []  # (begin, end)
        self.begin()

    def go_away(self, seconds: float) -> None:
        """Out of reach for so long; the connection stays."""
        now = time.monotonic()
        self.outages.append((now, now + seconds))
        self.away_until = now + seconds

    def hang_up(self) -> None:
        """Break the connection and take no other. Returns once it is broken."""
        self.refusing = True
        assert self.broken.wait(TIMEOUT_S)

    def come_back(self) -> None:
        """The module may be called again."""
        self.broken.clear()
        self.refusing = False

    def silences(self, to_host: bool) -> list[tuple[float, float]]:
        """(begin, end) of each time without a frame in one direction."""
        times = [each.at for each in self.passed if each.to_host == to_host]
        return list(pairwise(times))

    def let_go(self) -> None:
        for end in (self.server, self.host):
            if end is not None:
                end.close()
        os.close(self.board)

    def live(self) -> None:
        while not self.over.is_set():
            files: list[int | socket.socket] = [self.board, self.server]
            if self.host is not None:
                files.append(self.host)
            select.select(files, [], [], POLL_PERIOD_S)
            if self.refusing:
                self._drop()
            else:
                self._answer()
            self._once(time.monotonic())

    def _answer(self) -> None:
        with suppress(BlockingIOError):
            caller, _ = self.server.accept()
            if self.host is not None:
                caller.close()  # one at a time
                return
            caller.setblocking(False)
            self.host = caller

    def _drop(self) -> None:
        if self.host is not None:
            self.host.close()
            self.host = None
        with suppress(BlockingIOError):
            self.server.accept()[0].close()
        self.broken.set()

    def _once(self, now: float) -> None:
        away = now < self.away_until
        payload = self._host_bytes()

        def full(size: int) -> bool:
            return (away and size > BUFFER) or self.host is None

        self.up.take(now, read_available(self.board), full)
        self.down.take(now, payload, full)
        if away:
            return
        for frame in self.up.due(now):
            self._deliver(now, True, frame)
        for frame in self.down.due(now):
            self._deliver(now, False, frame)

    def _host_bytes(self) -> bytes:
        if self.host is None:
            return b""
        try:
            payload = self.host.recv(4096)
        except BlockingIOError:
            return b""
        except ConnectionResetError:
            payload = b""
        if not payload:
            self.host.close()
            self.host = None
        return payload

    def _deliver(self, now: float, to_host: bool, frame: bytes) -> None:
        with suppress(BlockingIOError, BrokenPipeError):
            if not to_host:
                os.write(self.board, frame)
            elif self.host is not None:
                self.host.send(frame)
            else:
                return
            self.passed.append(DeliveredFrame(now, to_host, frame))
