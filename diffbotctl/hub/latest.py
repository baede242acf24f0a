"""What a run last said, for screens: the newest message of each kind, sent on ten times a second.

The channel drops: a screen that is slow, stopped or dead costs the engine nothing.
"""

from __future__ import annotations

import pickle
import socket
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from diffbotctl.messages import LogLine, Message

MOST_LINES = 200  # of the log that wait for a screen; one that is stopped gets the newest
PERIOD = 100_000_000  # ns of logical time between two pictures


class Snapshot(NamedTuple):
    """The newest message of each wire that a screen shows, by wire, and how the goals go.

    `lines` are those of the log since the picture before.
    """

    time: int
    messages: dict[str, Message]
    reached: int
    goals: int
    lines: tuple[LogLine, ...] = ()


class Latest:
    """Keeps the newest message of each watched wire, and sends a Snapshot now and then."""

    def __init__(
        self,
        channel: socket.socket,
        progress: Callable[[], tuple[int, int]],
        gone: Callable[[], None] | None = None,
    ) -> None:
        self.channel = channel
        self.gone = gone  # called once, when the screen is no longer there
        self.progress = progress
        self.messages: dict[str, Message] = {}
        self.lines: deque[LogLine] = deque(maxlen=MOST_LINES)
        self.next = 0
        channel.setblocking(False)

    def sink(self, wire: str) -> Callable[[int, Any], None]:
        """A sink that keeps what comes on `wire`."""
        messages = self.messages

        def keep(now: int, message: Any) -> None:
            messages[wire] = message

        return keep

    def hear(self, now: int, line: LogLine) -> None:
        """Take a line of the log; it waits for the next picture that goes through."""
        self.lines.append(line)

    def idle(self, now: int) -> None:
        """Send a picture when one is due."""
        if now < self.next:
            return
        self.next = now + PERIOD
        self._picture(now)

    def finish(self, now: int) -> None:
        """Send the last picture, waiting for the screen, and say that it was the last."""
        self.channel.setblocking(True)
        self._picture(now)
        self.send(None)
        self.channel.close()

    def send(self, item: object) -> bool:
        """Send one datagram; a full channel drops it, which is False."""
        try:
            self.channel.send(pickle.dumps(item, pickle.HIGHEST_PROTOCOL))
        except BlockingIOError:
            return False
        except (ConnectionRefusedError, BrokenPipeError, ConnectionResetError):
            gone, self.gone = self.gone, None
            if gone is not None:
                gone()
            return False
        return True

    def _picture(self, now: int) -> None:
        if self.send(Snapshot(now, self.messages, *self.progress(), tuple(self.lines))):
            self.lines.clear()
