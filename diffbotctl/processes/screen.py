"""What a run last said, for screens: the newest message of each kind, sent on ten times a second.

The channel drops: a screen that is slow, stopped or dead costs the engine nothing.

A screen in a process of its own: it can never slow the engine. One that only shows is idle.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple

from diffbotctl.messages import LogLine, Message
from diffbotctl.processes.child_process import fork_with_channel

MOST_LINES = 200  # of the log that wait for a screen; one that is stopped gets the newest
PERIOD = 100_000_000  # ns of logical time between two pictures


class RunSnapshot(NamedTuple):
    """The newest message of each wire that a screen shows, by wire, and how the goals go.

    `lines` are those of the log since the picture before.
    """

    time: int
    messages: dict[str, Message]
    reached: int
    goals: int
    lines: tuple[LogLine, ...] = ()


class ScreenFeed:
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
        if self.send(RunSnapshot(now, self.messages, *self.progress(), tuple(self.lines))):
            self.lines.clear()


NICENESS = 2  # the control path goes first; a lost word of whoever drives would stop the robot
LARGEST = 1 << 18  # bytes of one picture


def start_screen(
    show: Callable[[Iterator[RunSnapshot]], None], drives: bool = False
) -> tuple[socket.socket, int]:
    """Fork a process that runs `show` over the pictures sent to the returned channel.

    One that `drives` as well handles its signals itself, and gets its share of the processor.
    """

    def serve(channel: socket.socket) -> int:
        _alert() if drives else _quiet()
        with suppress(BrokenPipeError):
            show(_pictures(channel))
        return 0

    return fork_with_channel(serve, packets=True, buffer=None)


def _quiet() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def _alert() -> None:
    """SIGINT stays ignored: its terminal is raw, and Ctrl-C is a key."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    with suppress(OSError):
        os.nice(NICENESS)


def _pictures(channel: socket.socket) -> Iterator[RunSnapshot]:
    """Pictures until the engine ends or dies."""
    while True:
        data = channel.recv(LARGEST)
        if not data:
            return
        picture = pickle.loads(data)
        if picture is None:
            return
        yield picture
