"""The last minutes of a run's inputs, in memory: from the run's start or from a known state."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Iterator
from typing import Any

from diffbotctl.engine.flight import State
from diffbotctl.graph import SECOND

SPAN = 180 * SECOND  # ns that are kept at the least, once the run is that old
MOST = 24 << 20  # bytes; three minutes of a 50 Hz board take 3 MB


class Ring:
    """Batches of instants as they came, still pickled, and the states between them.

    It forgets from one state to the next, so that what is left can be replayed exactly. Without
    states, when a block cannot give one, it forgets as it goes: `known` is then False.
    """

    def __init__(self, span: int = SPAN, most: int = MOST) -> None:
        self.span, self.most = span, most
        self.batches: deque[tuple[int, bytes]] = deque()
        self.states: deque[State] = deque()
        self.begin: State | None = None
        self.known = True
        self.size = 0
        self.last = 0

    def keep(self, time: int, data: bytes) -> None:
        """Keep a pickled list of instants, the last of which was at `time`."""
        self.batches.append((time, data))
        self.size += len(data)
        self.last = time
        self._forget()

    def mark(self, state: State) -> None:
        """Keep a state: what comes after it can be replayed from here."""
        self.states.append(state)
        self.size += len(state.data)
        self._forget()

    def instants(self) -> Iterator[tuple[Any, ...]]:
        """All that is kept, in order."""
        for _, data in self.batches:
            yield from pickle.loads(data)

    def _forget(self) -> None:
        old = self.last - self.span
        while self.states and (self.states[0].time <= old or self.size > self.most):
            self.begin = self.states.popleft()
            self.known = True
            self._drop(self.begin.time)
            self.size -= len(self.begin.data)
        if self.size > self.most or (not self.states and self._is_late(old)):
            self._drop(max(old, self.batches[0][0]))
            self.begin, self.known = None, False

    def _is_late(self, old: int) -> bool:
        """No state has come for as long again as the span: none will."""
        return bool(self.batches) and self.batches[0][0] < old - self.span

    def _drop(self, until: int) -> None:
        while self.batches and self.batches[0][0] <= until:
            self.size -= len(self.batches.popleft()[1])
