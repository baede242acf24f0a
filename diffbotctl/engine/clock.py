"""Clocks: they say when it is, and wait. Logical time is ns since the start of the run."""

from __future__ import annotations

import select
import time
from typing import Protocol

from diffbotctl.time import NEVER, SECOND

FILE_POLL_INSTANTS = 64  # between two polls of the files; about 1 ms of an unpaced run
MAX_SLEEP = 3600 * SECOND


class Clock(Protocol):
    """Waits for a logical time or for a file that can be read.

    `late`: ns by which the last `wait` returned after the time it was asked for.
    """

    late: int

    def wait(self, until: int, files: list[int]) -> tuple[int, list[int]]:
        """Return (the logical time it is, files ready) at `until` or as soon as a file is ready."""

    def close(self) -> None:
        """Nobody waits any longer."""


class VirtualClock:
    """Time jumps to the next event: simulation and replay as fast as they go."""

    def __init__(self) -> None:
        self.poller = _Poller()
        self.waits = self.late = 0

    def wait(self, until: int, files: list[int]) -> tuple[int, list[int]]:
        """Jump to `until`; files are looked at only now and then, for they mean people."""
        self.waits += 1
        ready = (
            self.poller.ready(0, files) if files and self.waits % FILE_POLL_INSTANTS == 0 else []
        )
        return until, ready

    def close(self) -> None:
        """Nobody waits any longer."""
        self.poller.close()


class PacedClock:
    """Time of the wall since the start, for real robots and for simulation at real speed.

    `exact`: report the time that was asked for rather than the moment of waking, so that a paced
    simulation has the same logical times as an unpaced one.
    """

    def __init__(self, exact: bool) -> None:
        self.exact = exact
        self.poller = _Poller()
        self.late = 0
        self.start = time.monotonic_ns()

    def wait(self, until: int, files: list[int]) -> tuple[int, list[int]]:
        """Sleep until `until` or until a file can be read."""
        remaining = until - (time.monotonic_ns() - self.start)
        ready = self.poller.ready(max(remaining, 0), files)
        now = time.monotonic_ns() - self.start
        self.late = now - until
        return (until if self.exact and not ready else now), ready

    def close(self) -> None:
        """Nobody waits any longer."""
        self.poller.close()


class ScaledClock:
    """`speed` times the wall's time from the logical time `begin` on; before it, time jumps."""

    def __init__(self, speed: float, begin: int) -> None:
        self.speed = speed
        self.begin = begin
        self.start: int | None = None
        self.late = 0

    def wait(self, until: int, files: list[int]) -> tuple[int, list[int]]:
        """Sleep until the wall has come to `until`. No file is looked at."""
        if until >= NEVER:
            return until, []
        if until > self.begin:
            now = time.monotonic_ns()
            self.start = now if self.start is None else self.start
            remaining = (until - self.begin) / self.speed - (now - self.start)
            time.sleep(max(remaining, 0.0) / SECOND)
        return until, []

    def close(self) -> None:
        """Nobody waits any longer."""


class _Poller:
    """Waits with nanoseconds; poll() alone knows only whole milliseconds."""

    def __init__(self) -> None:
        self.epoll = select.epoll()
        self.files: list[int] = []

    def ready(self, remaining: int, files: list[int]) -> list[int]:
        if files != self.files:
            self._watch(files)
        if not files:
            time.sleep(min(remaining, MAX_SLEEP) / SECOND)
            return []
        # epoll rounds up to a millisecond; sleep the rest short of it so that timers stay sharp.
        seconds = min(remaining, MAX_SLEEP) / SECOND
        return [file for file, _ in self.epoll.poll(seconds)]

    def close(self) -> None:
        self.epoll.close()

    def _watch(self, files: list[int]) -> None:
        self.epoll.close()
        self.epoll = select.epoll()
        for file in files:
            self.epoll.register(file, select.EPOLLIN)
        self.files = list(files)
