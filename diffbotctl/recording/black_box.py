"""The engine's end of the flight recorder: what the drivers delivered, kept for the day it stops.

The hub holds the last minutes in memory and has them written at a stop. The blocks' messages are
not sent: a replay makes them anew, from a state taken now and then.
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import Any, NamedTuple

from diffbotctl.messages import Stop
from diffbotctl.recording.recorder import ChildSender, drain_batch
from diffbotctl.time import SECOND

PATIENCE = 1.0  # s that the end of a run waits for a hub which takes nothing
SNAPSHOT = 30 * SECOND  # between two states; each costs a third of a millisecond of idle time


class StopEvent(NamedTuple):
    """Something stopped the robot at `time` (ns)."""

    time: int
    code: str
    cause: str


class EngineState(NamedTuple):
    """The state of all blocks after the instant `time` (ns), with all inputs up to then sent."""

    time: int
    data: bytes


class BlackBox:
    """Gathers what drivers deliver: the first `sources` messages of each instant.

    `snapshot` returns the state between two instants, or None when it has no bytes. `announce` is
    called with each file that was written, `tell` once, with the reason, when this has failed.
    """

    def __init__(
        self,
        channel: socket.socket,
        sources: int,
        snapshot: Callable[[], bytes | None],
        announce: Callable[[str], None],
        tell: Callable[[str], None],
    ) -> None:
        self.outlet = ChildSender(channel, False, tell)
        self.end = sources + 1
        self.snapshot = snapshot
        self.announce = announce
        self.pending: list[tuple[Any, ...]] = []
        self.stops: list[StopEvent] = []
        self.record: Callable[[tuple[Any, ...]], object] = self.pending.append
        self.next = SNAPSHOT
        self.last = 0

    def stop(self, now: int, stop: Stop) -> None:
        """A sink for stops."""
        if stop.code:
            self.stops.append(StopEvent(now, stop.code, stop.cause))

    def drain(self) -> None:
        """Hand on what has gathered. Called in the loop's idle time, after commands have left."""
        if not self.pending or not (self.stops or drain_batch(self.pending)):
            return
        self._send()
        if self.last >= self.next:
            self.next = self.last + SNAPSHOT
            data = self.snapshot()
            if data is not None:
                self.outlet.send(EngineState(self.last, data))
        said = self.outlet.hear()
        if said is not None:
            self._announce(said)

    def finish(self, summary: dict[str, str]) -> None:
        """Hand on the rest with how the run ended. A hub that hangs is given up."""
        self.outlet.channel.settimeout(PATIENCE)
        self._send()
        self.outlet.send(summary)
        self.outlet.finish()

    def close(self) -> None:
        """Announce what was written because of the end, once it has been: the hub has gone."""
        self._announce(self.outlet.close())

    def _send(self) -> None:
        if self.pending:
            self.last = self.pending[-1][0]
        heard = [instant[: self.end] for instant in self.pending]
        inputs = [each for each in heard if any(part is not None for part in each[1:])]
        self.pending.clear()
        if inputs:
            self.outlet.send(inputs)
        for stop in self.stops:
            self.outlet.send(stop)
        self.stops.clear()

    def _announce(self, said: str) -> None:
        for line in said.splitlines():
            self.announce(line)
