"""Measures the computing time of each block, only on request.

On a request the `react` functions are replaced by timed ones, and restored some seconds after the
last request, so that a run without requests has no overhead. Logical time and messages are not
affected.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from diffbotctl.engine.loop import Engine
from diffbotctl.time import SECOND

REPORT_PERIOD = SECOND  # wall-clock time over which the load is averaged
REQUEST_TIMEOUT = 5 * SECOND  # wall-clock time after the last request; then measuring ends


class BlockLoad(NamedTuple):
    """Load of a block: share of one core, reactions per second, late timer firings so far."""

    busy: float
    reactions: float
    overruns: int


class BlockProfiler:
    """Measures the blocks of `engine`, whose names begin with `prefix`.

    `is_on`: it is measuring, and `report` has to be called.
    """

    def __init__(self, engine: Engine, prefix: str = "") -> None:
        self.engine = engine
        self.prefix = prefix
        nodes = [node.name for node in engine.graph.nodes]
        self.names = [name for name in nodes if name.startswith(prefix)]
        self.spent = [0] * len(self.names)
        self.count = [0] * len(self.names)
        self.requested_until = self.period_start = 0
        self.is_on = False
        self._reactions: dict[str, Callable[..., Any]] = {}  # what was called before

    def request(self) -> None:
        """Start measuring, or continue for another REQUEST_TIMEOUT."""
        now = time.perf_counter_ns()
        self.requested_until = now + REQUEST_TIMEOUT
        if not self.is_on:
            self.is_on = True
            compiled = self.engine.compiled
            for place, name in enumerate(self.names):
                self._reactions[name] = compiled.reaction(name)
                compiled.swap(name, self._timed_react(place, self._reactions[name]))
            self._start_period(now)

    def report(self) -> dict[str, BlockLoad] | None:
        """The load of each block at the end of a period, else None. Stops after REQUEST_TIMEOUT."""
        now = time.perf_counter_ns()
        if now > self.requested_until:
            self.is_on = False
            for name, react in self._reactions.items():
                self.engine.compiled.swap(name, react)
        span = now - self.period_start
        if span < REPORT_PERIOD:
            return None
        loads = {
            name.removeprefix(self.prefix): BlockLoad(
                spent / span, count * SECOND / span, self.engine.overruns.get(name, 0)
            )
            for name, spent, count in zip(self.names, self.spent, self.count, strict=True)
        }
        self._start_period(now)
        return loads

    def _start_period(self, now: int) -> None:
        self.period_start = now
        for place in range(len(self.names)):
            self.spent[place] = self.count[place] = 0

    def _timed_react(self, place: int, react: Callable[..., Any]) -> Callable[..., Any]:
        spent, count, clock = self.spent, self.count, time.perf_counter_ns

        def timed_react(*arguments: Any) -> Any:
            start = clock()
            output = react(*arguments)
            spent[place] += clock() - start
            count[place] += 1
            return output

        return timed_react
