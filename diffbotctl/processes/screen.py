"""The screen of a run: a child process that draws, and its feed of snapshots from the engine.

The feed sends the newest message of each wire ten times a second. Its channel drops what does not
fit: a screen that is slow, suspended or dead does not delay the engine.
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
from diffbotctl.time import MILLISECOND

LOG_LINES_MAX = 200  # that wait for a screen; one that is suspended gets the newest
SNAPSHOT_PERIOD = 100 * MILLISECOND  # of logical time
SNAPSHOT_MAX_BYTES = 1 << 18
FINISH_TIMEOUT_S = 1.0  # twice: for a screen that draws, not for a terminal that takes nothing
# Of a screen that only shows: beside an engine that is paced, and beside one that computes all the
# time. At idle priority, a busy computer would never show the end of a run.
PACED_NICENESS, FAST_NICENESS = 10, 5
DRIVING_NICENESS = 2  # the control path has priority; a late drive command would stop the robot


class RunSnapshot(NamedTuple):
    """The newest message of each wire that a screen shows, by wire, and the count of goals.

    `lines` are those of the log since the snapshot before. The last snapshot of a run has the
    cause of its end in `ending`, and `has_failed`.
    """

    time: int
    messages: dict[str, Message]
    reached: int
    goals: int
    lines: tuple[LogLine, ...] = ()
    ending: str = ""
    has_failed: bool = False


class ScreenFeed:
    """Keeps the newest message of each wire, and sends a RunSnapshot every SNAPSHOT_PERIOD.

    `progress` returns (goals reached, goals); `on_exit` is called once, when the screen has ended.
    """

    def __init__(
        self,
        channel: socket.socket,
        progress: Callable[[], tuple[int, int]],
        on_exit: Callable[[], None] | None = None,
    ) -> None:
        self.channel = channel
        self.on_exit = on_exit
        self.progress = progress
        self.messages: dict[str, Message] = {}
        self.lines: deque[LogLine] = deque(maxlen=LOG_LINES_MAX)
        self.due = 0
        channel.setblocking(False)

    def sink(self, wire: str) -> Callable[[int, Any], None]:
        """A sink that keeps the newest message on `wire`."""
        messages = self.messages

        def keep(now: int, message: Any) -> None:
            messages[wire] = message

        return keep

    def add_line(self, now: int, line: LogLine) -> None:
        """A sink for log lines; they wait for the next snapshot that is sent."""
        self.lines.append(line)

    def idle(self, now: int) -> None:
        if now >= self.due:
            self.due = now + SNAPSHOT_PERIOD
            self._send_snapshot(now)

    def finish(self, now: int, ending: str, has_failed: bool) -> None:
        """Send the last snapshot, waiting a moment for the screen, and end the feed."""
        self.on_exit = None  # a screen that leaves at the end of the run is not gone too early
        self.channel.settimeout(FINISH_TIMEOUT_S)
        self._send_snapshot(now, ending, has_failed)
        self._send(None)
        self.channel.close()

    def _send_snapshot(self, now: int, ending: str = "", has_failed: bool = False) -> None:
        lines = tuple(self.lines)
        snapshot = RunSnapshot(now, self.messages, *self.progress(), lines, ending, has_failed)
        if self._send(snapshot):
            self.lines.clear()

    def _send(self, snapshot: RunSnapshot | None) -> bool:
        """Send one datagram. False when it was dropped because the channel is full."""
        try:
            self.channel.send(pickle.dumps(snapshot, pickle.HIGHEST_PROTOCOL))
        except (BlockingIOError, TimeoutError):
            return False
        except (ConnectionRefusedError, BrokenPipeError, ConnectionResetError):
            on_exit, self.on_exit = self.on_exit, None
            if on_exit is not None:
                on_exit()
            return False
        return True


def start_screen(
    show: Callable[[Iterator[RunSnapshot]], None], drives: bool = False, is_paced: bool = True
) -> tuple[socket.socket, int]:
    """Fork a process that runs `show` over the snapshots sent to the returned channel.

    `drives`: it can also drive the robot, so it handles signals itself and gets processor time.
    Otherwise it gets less than the engine, above all beside one that is paced. Returns the engine's
    end of the channel and the pid.
    """

    def serve(channel: socket.socket) -> int:
        if drives:  # SIGINT stays ignored: the terminal is raw, and Ctrl-C is a key
            for number in (signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, signal.SIG_DFL)
        else:
            signal.signal(signal.SIGHUP, signal.SIG_DFL)
        with suppress(OSError):
            os.nice(DRIVING_NICENESS if drives else PACED_NICENESS if is_paced else FAST_NICENESS)
        with suppress(BrokenPipeError):
            show(_snapshots(channel))
        return 0

    return fork_with_channel(serve, packets=True, buffer=None)


def _snapshots(channel: socket.socket) -> Iterator[RunSnapshot]:
    """Snapshots until the engine ends or dies."""
    while data := channel.recv(SNAPSHOT_MAX_BYTES):
        snapshot = pickle.loads(data)
        if snapshot is None:
            return
        yield snapshot
