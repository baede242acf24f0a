"""The last minutes of a run's inputs, in memory: from the run's start or from a known state."""

from __future__ import annotations

import io
import pickle
import zlib
from collections import deque
from collections.abc import Iterator
from typing import Any

from diffbotctl.engine.flight import State
from diffbotctl.graph import SECOND

SPAN = 180 * SECOND  # ns that are kept at the least, once the run is that old
MOST = 24 << 20  # bytes; three minutes of a 50 Hz board take half a megabyte
LOOSE = 32 << 10  # bytes that are compressed in one go: each few seconds, in a millisecond


class Ring:
    """Batches of instants as they came, pickled and then compressed, and the states between them.

    It forgets from one state to the next, so that what is left can be replayed exactly. Without
    states, when a block cannot give one, it forgets as it goes: `known` is then False.
    """

    def __init__(self, span: int = SPAN, most: int = MOST, packet: int = LOOSE) -> None:
        self.span, self.most, self.packet = span, most, packet
        self.blocks: deque[tuple[int, bytes]] = deque()  # (time of the last instant, compressed)
        self.loose: list[bytes] = []
        self.states: deque[State] = deque()
        self.begin: State | None = None
        self.known = True
        self.size = 0
        self.last = 0

    def keep(self, time: int, data: bytes) -> None:
        """Keep a pickled list of instants, the last of which was at `time`."""
        self.loose.append(data)
        self.size += len(data)
        self.last = time
        if sum(map(len, self.loose)) >= self.packet:
            self._pack()
        self._forget()

    def mark(self, state: State) -> None:
        """Keep a state: what comes after it can be replayed from here."""
        self._pack()  # a block never reaches from before a state to behind it
        self.states.append(state)
        self.size += len(state.data)
        self._forget()

    def instants(self) -> Iterator[tuple[Any, ...]]:
        """All that is kept, in order."""
        for _, block in self.blocks:
            yield from _unpickled(zlib.decompress(block))
        yield from _unpickled(b"".join(self.loose))

    def _pack(self) -> None:
        if not self.loose:
            return
        block = zlib.compress(b"".join(self.loose), 1)
        self.size += len(block) - sum(map(len, self.loose))
        self.blocks.append((self.last, block))
        self.loose.clear()

    def _forget(self) -> None:
        old = self.last - self.span
        while self.states and (self.states[0].time <= old or self.size > self.most):
            self.begin = self.states.popleft()
            self.known = True
            self._drop(self.begin.time)
            self.size -= len(self.begin.data)
        if self.blocks and (self.size > self.most or self._is_late(old)):
            self._drop(max(old, self.blocks[0][0]))
            self.begin, self.known = None, False

    def _is_late(self, old: int) -> bool:
        """No state has come for as long again as the span: none will."""
        return not self.states and self.blocks[0][0] < old - self.span

    def _drop(self, until: int) -> None:
        while self.blocks and self.blocks[0][0] <= until:
            self.size -= len(self.blocks.popleft()[1])


def _unpickled(data: bytes) -> Iterator[tuple[Any, ...]]:
    """The instants of pickled lists that follow one another."""
    file = io.BytesIO(data)
    while file.tell() < len(data):
        yield from pickle.load(file)
