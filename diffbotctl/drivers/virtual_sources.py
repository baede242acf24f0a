"""Sources that only compute, in a run that follows no real time: the engine waits for each answer.

An answer comes `virtual_delay` after its message, in the time of the run. So a simulated run is the
same each time, however busy the computer is.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from diffbotctl.config.configuration import SourceUse
from diffbotctl.device import DeviceDriver, DeviceError
from diffbotctl.engine.driver import Delivery
from diffbotctl.errors import Problem, RunError
from diffbotctl.log import INFO, Log
from diffbotctl.messages import LogLevel
from diffbotctl.time import NEVER, SECOND

Report = Callable[[int, LogLevel, str, str], None]


class VirtualSource:
    """One source. Times are in ns."""

    def __init__(self, use: SourceUse, rehearses: bool) -> None:
        """`rehearses`: nothing is saved by itself."""
        self.use = use
        values = {**use.values, **({"autosave": False} if rehearses else {})}
        self.driver: DeviceDriver = use.cls(**values)
        self.driver.log = Log(use.name, [], INFO)
        self.delay = use.cls.virtual_delay or 0
        self.due: deque[int] = deque()  # of the answers to what was sent
        self.retry_at = NEVER
        (self.port,) = [wire.rpartition(".")[2] for wire in use.outputs]

    def take(self, now: int, port: str, message: Any) -> None:
        """Send a message, whose answer is then due."""
        if self.retry_at < NEVER:
            return
        self.driver.write(now, port, message)
        self.due.append(now + self.delay)


class VirtualSources:
    """A driver with all of them."""

    def __init__(self, uses: Sequence[SourceUse], report: Report, rehearses: bool) -> None:
        """`report` takes time, level, source and text of what is wrong."""
        self.sources = [VirtualSource(use, rehearses) for use in uses]
        self.report = report
        for source in self.sources:
            try:
                source.driver.open()
            except (OSError, DeviceError) as error:
                problem = Problem("E-DEVICE", source.use.place, str(error), "run it again")
                raise RunError(problem) from error

    def sinks(self) -> Iterator[tuple[str, Callable[[int, Any], None]]]:
        """The wires that they take, and what takes their messages."""
        for source in self.sources:
            for port, wire in source.use.wires.items():
                yield wire, self._sink(source, port)

    def _sink(self, source: VirtualSource, port: str) -> Callable[[int, Any], None]:
        def take(now: int, message: Any) -> None:
            try:
                source.take(now, port, message)
            except DeviceError as error:
                self._lose(now, source, error)

        return take

    def due(self) -> int:
        """When the next answer comes, or a process that has ended is started again."""
        return min(
            (min(source.due[0] if source.due else NEVER, source.retry_at))
            for source in self.sources
        )

    def files(self) -> list[int]:
        """None: answers come at times of the run."""
        return []

    def deliver(self, now: int) -> list[Delivery]:
        """The answers that are due; waits for them."""
        deliveries = []
        for source in self.sources:
            if now >= source.retry_at:
                source.retry_at = NEVER
                source.driver.open()
            while source.due and source.due[0] <= now:
                source.due.popleft()
                try:
                    answer = source.driver.answer()
                except DeviceError as error:
                    self._lose(now, source, error)
                    break
                deliveries.append(Delivery(source.use.wire(source.port), answer))
        return deliveries

    def close(self) -> None:
        for source in self.sources:
            source.driver.close()

    def _lose(self, now: int, source: VirtualSource, error: DeviceError) -> None:
        """The process has ended: start another one in a second."""
        source.due.clear()
        source.retry_at = now + SECOND
        self.report(now, "error", source.use.name, f"{error.cause}; {error.fix}")


def open_virtual_sources(
    uses: Sequence[SourceUse], report: Report, rehearses: bool
) -> VirtualSources | None:
    """The driver of `uses`; None without one. Raises RunError."""
    return VirtualSources(uses, report, rehearses) if uses else None
