"""Black box, engine side: the source messages of the last 3 minutes, and states between them.

The blocks' messages are not sent: a replay computes them again, from a state that is saved every
SNAPSHOT_PERIOD. The child side, in diffbotctl.recording.black_box_store, keeps them in memory and
writes them to a file when the robot is stopped.
"""

import socket
from collections.abc import Callable
from typing import Any, NamedTuple

from diffbotctl.messages import STARTING, Stop
from diffbotctl.processes.child_process import ChildSender
from diffbotctl.recording.recorder import spans_batch
from diffbotctl.recording.snapshot import StateError
from diffbotctl.time import SECOND

FINISH_TIMEOUT_S = 1.0  # that the end of a run waits for a server process that reads nothing
ENDS_WITHOUT_REASON = ("0", "3", "130")  # exit codes: goals reached, not surely, interrupted
NOTICE_END = "\n\n"
SNAPSHOT_PERIOD = 30 * SECOND  # each takes a third of a millisecond of idle time


class StopEvent(NamedTuple):
    """A block or driver stopped the robot at `time` (ns)."""

    time: int
    code: str
    cause: str


class EngineState(NamedTuple):
    """The pickled state of all blocks after the instant `time` (ns), whose inputs were all sent.

    `problem`: why there is none; `data` is then empty.
    """

    time: int
    data: bytes
    problem: str = ""


class BlackBox:
    """Gathers what drivers deliver: the first `sources` messages of each instant.

    `snapshot` returns the state between two instants, None for none; it raises StateError when that
    of a block cannot be saved.
    `announce` is called at the end with the lines about the last file, `on_loss` once, with the
    reason, when recording has failed.
    """

    def __init__(
        self,
        channel: socket.socket,
        sources: int,
        snapshot: Callable[[], bytes | None],
        announce: Callable[[str], None],
        on_loss: Callable[[str], None],
    ) -> None:
        self.sender = ChildSender(channel, False, on_loss)
        self.end = sources + 1
        self.snapshot = snapshot
        self.announce = announce
        self.pending: list[tuple[Any, ...]] = []
        self.stops: list[StopEvent] = []
        self.record: Callable[[tuple[Any, ...]], object] = self.pending.append
        self.snapshot_due = SNAPSHOT_PERIOD
        self.last = 0
        self.notices = ""  # about files that were written
        self.has_reason = False  # something stopped the robot, or the run failed

    def stop(self, now: int, stop: Stop) -> None:
        if stop.code and stop.code != STARTING:
            self.has_reason = True
            self.stops.append(StopEvent(now, stop.code, stop.cause))

    def drain(self) -> None:
        """Send what has gathered. Called in the loop's idle time, after commands have left."""
        if not self.pending or not (self.stops or spans_batch(self.pending)):
            return
        self._send()
        if self.last >= self.snapshot_due:
            self.snapshot_due = self.last + SNAPSHOT_PERIOD
            try:
                data = self.snapshot()
                state = None if data is None else EngineState(self.last, data)
            except StateError as error:
                state = EngineState(self.last, b"", str(error))
            if state is not None:
                self.sender.send(state)
        self.notices += self.sender.receive() or ""

    def finish(self, summary: dict[str, str]) -> None:
        """Send the rest, and `summary`: how the run ended. A process that hangs is given up."""
        self.sender.channel.settimeout(FINISH_TIMEOUT_S)
        self._send()
        self.has_reason |= summary["code"] not in ENDS_WITHOUT_REASON
        self.sender.send(summary)
        self.sender.finish()

    def close(self) -> None:
        """Wait until the other process has ended, and announce the last file that it wrote.

        Nothing is announced when the run was ended by its goals, its time or a person.
        """
        self.notices += self.sender.close()
        *_, last = ["", *filter(None, self.notices.split(NOTICE_END))]
        for line in last.splitlines() if self.has_reason else ():
            self.announce(line)

    def _send(self) -> None:
        if self.pending:
            self.last = self.pending[-1][0]
        delivered = (instant[: self.end] for instant in self.pending)
        inputs = [
            instant for instant in delivered if any(message is not None for message in instant[1:])
        ]
        self.pending.clear()
        if inputs:
            self.sender.send(inputs)
        for stop in self.stops:
            self.sender.send(stop)
        self.stops.clear()
