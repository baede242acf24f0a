"""How long each block's reactions take, measured only while somebody watches.

Nothing is measured on the way of a run that nobody looks at: the reactions are swapped for timed
ones on request, and back again some seconds after the last request. Logical time and messages know
nothing of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from diffbotctl.engine.loop import Engine

PERIOD = 1_000_000_000  # ns of the wall over which a share is taken
PATIENCE = 5_000_000_000  # ns after the last request, then measuring ends


class BlockLoad(NamedTuple):
    """What a block cost: share of one core, reactions a second, timers fired too late so far."""

    busy: float
    reactions: float
    overruns: int


class BlockProfiler:
    """Watches the blocks of `engine`. `is_on`: somebody wants to see, so `idle` is to be called."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.names = [node.name for node in engine.graph.nodes]
        self.spent = [0] * len(self.names)
        self.count = [0] * len(self.names)
        self.wanted_until = self.since = 0
        self.is_on = False

    def want(self) -> None:
        """Measure from now on; without another word it ends after PATIENCE."""
        now = time.perf_counter_ns()
        self.wanted_until = now + PATIENCE
        if not self.is_on:
            self.is_on = True
            for place, node in enumerate(self.engine.graph.nodes):
                self.engine.compiled.swap(node.name, self._timed(place, node.block.react))
            self._begin(now)

    def idle(self) -> dict[str, BlockLoad] | None:
        """What each block cost, when a period is over. Ends measuring when nobody asks any more."""
        now = time.perf_counter_ns()
        if now > self.wanted_until:
            self.is_on = False
            for node in self.engine.graph.nodes:
                self.engine.compiled.swap(node.name, node.block.react)
        span = now - self.since
        if span < PERIOD:
            return None
        loads = {
            name: BlockLoad(spent / span, count * 1e9 / span, self.engine.overruns.get(name, 0))
            for name, spent, count in zip(self.names, self.spent, self.count, strict=True)
        }
        self._begin(now)
        return loads

    def _begin(self, now: int) -> None:
        self.since = now
        for place in range(len(self.names)):
            self.spent[place] = self.count[place] = 0

    def _timed(self, place: int, react: Callable[..., Any]) -> Callable[..., Any]:
        spent, count, clock = self.spent, self.count, time.perf_counter_ns

        def timed(*arguments: Any) -> Any:
            began = clock()
            made = react(*arguments)
            spent[place] += clock() - began
            count[place] += 1
            return made

        return timed
