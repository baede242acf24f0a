"""A session with one board, outside of any run; and the events that a job reports."""

from __future__ import annotations

import fcntl
import select
import struct
import termios
import time
from collections.abc import Iterator
from types import TracebackType
from typing import NamedTuple, Self

from diffbotctl.drivers.serial_port import disconnected_error, open_port
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.diffbot_states import HostState
from diffbotctl.messages import Text
from diffbotctl.time import SECOND

POLL_PERIOD_S = 0.05  # of a silent port
WRITE_TIMEOUT_S = 0.1  # until the next attempt, when the kernel takes no bytes
RESET_PULSE_S = 0.05  # the capacitor to the reset line needs a tenth of it


class JobMessage(NamedTuple):
    """A line of text for the user."""

    text: str


class JobProgress(NamedTuple):
    """Progress of a job."""

    what: str  # `writing`, `verifying`, `reading`
    done: int  # bytes
    total: int  # bytes


JobEvent = JobProgress | JobMessage


class BoardSession:
    """An open port with a board behind it: `with BoardSession(device, baud) as session`.

    The port is closed at the end. An OSError inside the block means that the port is gone; it is
    raised as the RunError for that.
    """

    def __init__(self, device: str, baud: int) -> None:
        """Raises RunError when the port cannot be opened."""
        self.device = device
        self._port = open_port(device, baud)
        self._start = time.monotonic_ns()
        self._unsent = b""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._port.close()
        if isinstance(error, OSError):
            raise disconnected_error(self.device, error) from error

    # --- bytes ---

    def reset(self) -> None:
        """Reset the board: drop DTR for a moment.

        A pseudo-terminal has no such line; there, as on a board, opening the port resets too.
        Raises RunError when it cannot be opened again.
        """
        line = struct.pack("I", termios.TIOCM_DTR)
        try:
            fcntl.ioctl(self._port.fd, termios.TIOCMBIC, line)
            time.sleep(RESET_PULSE_S)
            fcntl.ioctl(self._port.fd, termios.TIOCMBIS, line)
        except OSError:
            self._port.close()
            self._port = open_port(self.device, self._port.baud)

    def change_baud(self, baud: int) -> None:
        """Change the rate of the port. Raises OSError."""
        self._port.change_baud(baud)

    def read(self, timeout: float) -> bytes:
        """Bytes that arrive within `timeout` seconds; b"" when none do. Raises OSError."""
        if not select.select([self._port.fd], [], [], max(0.0, timeout))[0]:
            return b""
        return self._port.read()

    def write(self, data: bytes) -> None:
        """Write all of `data`. Raises OSError."""
        while data:
            data = data[self._port.write(data) :]
            if data:
                select.select([], [self._port.fd], [], WRITE_TIMEOUT_S)

    # --- our firmware ---

    def connect(self, host: DiffbotHost) -> Iterator[JobMessage]:
        """Run the handshake until the board is ready to drive; yields its texts.

        Raises RunError when it cannot be driven, OSError.
        """
        self._start = time.monotonic_ns()
        self._unsent = b""
        host.opened(0)
        while host.state is not HostState.UP:
            refusal = host.refusal
            if refusal is not None:
                place = f"port {self.device}"
                raise RunError(Problem(refusal.code, place, refusal.cause, refusal.fix))
            yield from self._exchange(host, POLL_PERIOD_S)

    def run_for(self, host: DiffbotHost, seconds: float) -> Iterator[JobMessage]:
        """Keep the link up for `seconds`; yields the board's texts. Raises OSError."""
        end = self._now + round(seconds * SECOND)
        while (remaining := end - self._now) > 0:
            yield from self._exchange(host, min(POLL_PERIOD_S, remaining / SECOND))

    @property
    def _now(self) -> int:
        """ns since the start of the handshake."""
        return time.monotonic_ns() - self._start

    def _exchange(self, host: DiffbotHost, timeout: float) -> Iterator[JobMessage]:
        """Write what is due, wait for a reply, read it."""
        if not self._unsent and host.due() <= self._now:
            self._unsent = host.send(self._now)
        self._unsent = self._unsent[self._port.write(self._unsent) :]
        data = self.read(min(timeout, max(host.due() - self._now, 0) / SECOND))
        for _, message in host.receive(self._now, data) + host.on_time(self._now):
            if isinstance(message, Text):
                yield JobMessage(message.text)
        self._port.change_baud(host.baud)
