"""The engine's end of a recording, or of a log's file: compact records, handed on without waiting.

The other end lives in a child process. Nothing here formats text or touches a disk.
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import Any

from diffbotctl.engine.outlet import Outlet

BATCH = 256  # instants an unpaced run gathers before it hands them on
GATHERED = 100_000_000  # ns that a paced run gathers: waking the child costs more than what it does


class Recorder:
    """Gathers instants, or lines, and sends them as lists of tuples.

    `waits`: an unpaced run waits for the child; a paced one never does, and on overflow the
    recording is given up while the run goes on. `tell` is called once, with the reason, when the
    recording has become incomplete. `at_once`: what a person follows is not gathered.
    """

    def __init__(
        self,
        channel: socket.socket,
        waits: bool,
        tell: Callable[[str], None],
        at_once: bool = False,
    ) -> None:
        self.outlet = Outlet(channel, waits, tell)
        self.waits = waits
        self.at_once = at_once and not waits
        self.pending: list[tuple[Any, ...]] = []
        self.record: Callable[[tuple[Any, ...]], object] = self.pending.append

    @property
    def lost(self) -> str | None:
        """Why the recording is incomplete; None while it is not."""
        return self.outlet.lost

    def drain(self) -> None:
        """Hand on what has gathered. Called in the loop's idle time, after commands have left."""
        pending = self.pending
        if not pending or not (self.at_once or self._is_enough(pending)):
            return
        self.outlet.send(self.pending)
        self.pending.clear()
        self._listen()

    def _is_enough(self, pending: list[tuple[Any, ...]]) -> bool:
        return len(pending) >= BATCH or (not self.waits and gathered(pending))

    def close(self, summary: dict[str, str] | None = None) -> None:
        """Hand on the rest, waiting for the child; then say that this was all.

        Without loss a recording ends complete, with `summary` in it.
        """
        self.outlet.channel.setblocking(True)
        self._listen()
        self.outlet.send(self.pending)
        if summary is not None:
            self.outlet.send(summary)
        self.outlet.finish()
        trouble = self.outlet.close()
        if trouble:
            self.outlet.give_up(trouble)

    def _listen(self) -> None:
        """Hear whether the child is in trouble: it speaks of nothing else."""
        trouble = self.outlet.hear()
        if trouble is not None:
            self.outlet.give_up(trouble)


def gathered(instants: list[tuple[Any, ...]]) -> bool:
    """Whether they are worth waking a child for."""
    return bool(instants[-1][0] - instants[0][0] >= GATHERED)
