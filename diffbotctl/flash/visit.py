"""A visit to a board with our firmware, outside of any run: meet it, have it do things, leave."""

from __future__ import annotations

import select
import time
from collections.abc import Iterator

from diffbotctl.drivers.port import OpenPort
from diffbotctl.errors import Problem, RunError
from diffbotctl.flash.events import Said
from diffbotctl.links.diffbot import UP, DiffbotHost
from diffbotctl.messages import Text

SECOND = 1_000_000_000
LOOK = 0.05  # s between two looks at a silent port


class Visit:
    """One board behind an open port, which stays its owner's to close."""

    def __init__(self, port: OpenPort, host: DiffbotHost) -> None:
        self.port, self.host = port, host
        self._start = time.monotonic_ns()
        self._unsent = b""
        host.opened(0)

    @property
    def now(self) -> int:
        """ns since the visit began."""
        return time.monotonic_ns() - self._start

    def meet(self) -> Iterator[Said]:
        """Until the board is ready to drive. Raises RunError when it cannot be driven, OSError."""
        while self.host.state != UP:
            refusal = self.host.refusal
            if refusal is not None:
                place = f"port {self.port.device}"
                raise RunError(Problem(refusal.code, place, refusal.cause, refusal.fix))
            yield from self._turn(LOOK)

    def stay(self, seconds: float) -> Iterator[Said]:
        """Talk on for so long. Raises OSError."""
        until = self.now + round(seconds * SECOND)
        while (left := until - self.now) > 0:
            yield from self._turn(min(LOOK, left / SECOND))

    def _turn(self, wait: float) -> Iterator[Said]:
        """Write what is due, wait for an answer, read it."""
        host = self.host
        if not self._unsent and host.due() <= self.now:
            self._unsent = host.send(self.now)
        self._unsent = self._unsent[self.port.write(self._unsent) :]
        wait = min(wait, max(host.due() - self.now, 0) / SECOND)
        select.select([self.port.fd], [], [], wait)
        data = self.port.read()
        for _port, heard in host.receive(self.now, data) + host.timed(self.now):
            if isinstance(heard, Text):
                yield Said(heard.text)
        self.port.change_baud(host.baud)
