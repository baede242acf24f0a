"""Clocks: read the logical time, in ns since the start of the run, and wait for it."""

from __future__ import annotations

import select
import time
from typing import Protocol

from diffbotctl.time import NEVER, SECOND

FILE_POLL_INSTANTS = 64  # between two polls of the files; about 1 ms of an unpaced run
MAX_SLEEP = 3600 * SECOND


class Clock(Protocol):
    """Waits for a logical time or for a readable file.

    `late`: ns by which the last `wait` returned after the requested time. `overslept`: ns
    for which it waited beyond that time. `busy`: ns between the `wait` before it and its call. The
    last two are 0 where no time passes meanwhile.
    """

    late: int
    overslept: int
    busy: int

    def wait(self, until: int, files: list[int]) -> tuple[int, list[int]]:
        """Return (logical time, readable files) at `until`, or earlier when a file is readable."""

    def close(self) -> None:
        """Release all resources."""


class VirtualClock:
    """Jumps to the next event, for simulation and replay at full speed."""

    def __init__(self) -> None:
        self.poller = _Poller()
        self.waits = self.late = self.overslept = self.busy = 0

    def wait(self, until: int, files: list[int]) -> tuple[int, list[int]]:
        """Jump to `until`. Files are polled only from time to time: they carry user commands."""
        self.waits += 1
        ready = (
            self.poller.ready(0, files) if files and self.waits % FILE_POLL_INSTANTS == 0 else []
        )
        return until, ready

    def close(self) -> None:
        """Release the poller's file descriptor."""
        self.poller.close()


class PacedClock:
    """Wall-clock time since the start, for real robots and for simulation in real time.

    `exact`: report the requested time instead of the time of waking, so that a paced simulation has
    the same logical times as an unpaced one.
    """

    def __init__(self, exact: bool) -> None:
        self.exact = exact
        self.poller = _Poller()
        self.late = self.overslept = self.busy = 0
        self.start = time.monotonic_ns()
        self._returned: int | None = None  # when the last `wait` did

    def wait(self, until: int, files: list[int]) -> tuple[int, list[int]]:
        """Sleep until `until`, or until a file is readable."""
        called = time.monotonic_ns() - self.start
        self.busy = 0 if self._returned is None else called - self._returned
        ready = self.poller.ready(max(until - called, 0), files)
        now = self._returned = time.monotonic_ns() - self.start
        self.late = now - until
        self.overslept = now - max(until, called)
        return (until if self.exact and not ready else now), ready

    def close(self) -> None:
        """Release the poller's file descriptor."""
        self.poller.close()


class ScaledClock:
    """`speed` times wall-clock time, from the logical time `begin` on; jumps to `begin`."""

    def __init__(self, speed: float, begin: int) -> None:
        self.speed = speed
        self.begin = begin
        self.start: int | None = None
        self.late = self.overslept = self.busy = 0

    def wait(self, until: int, files: list[int]) -> tuple[int, list[int]]:
        """Sleep until the logical time `until`. Files are ignored."""
        if until >= NEVER:
            return until, []
        if until > self.begin:
            now = time.monotonic_ns()
            self.start = now if self.start is None else self.start
            remaining = (until - self.begin) / self.speed - (now - self.start)
            time.sleep(max(remaining, 0.0) / SECOND)
        return until, []

    def close(self) -> None:
        """Do nothing: there are no resources to release."""


class _Poller:
    """Waits for readable files, or sleeps if there are none to wait for."""

    def __init__(self) -> None:
        self.epoll = select.epoll()
        self.files: list[int] = []

    def ready(self, remaining: int, files: list[int]) -> list[int]:
        if files != self.files:
            self._watch(files)
        if not files:
            time.sleep(min(remaining, MAX_SLEEP) / SECOND)
            return []
        # Python rounds the timeout of epoll up to a whole millisecond.
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
