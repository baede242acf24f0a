"""What works in a thread of its own beside a test, until it is closed."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Self

from diffbotctl.processes.real_time import prefer


class BackgroundDevice(ABC):
    """A fake device with its own thread. A constructor calls `begin` as its last step."""

    over: threading.Event

    @abstractmethod
    def live(self) -> None:
        """The thread's work; returns soon after `over` is set."""

    @abstractmethod
    def let_go(self) -> None:
        """Release files and sockets, after the thread has ended."""

    def begin(self) -> None:
        """Start the thread."""
        self.over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        prefer()
        self.live()

    def close(self) -> None:
        """End the thread, and release what it used."""
        self.over.set()
        self._thread.join()
        self.let_go()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@contextmanager
def repeating(act: Callable[[], object], period_s: float) -> Iterator[None]:
    """Call `act` every `period_s` seconds, in a thread."""
    over = threading.Event()

    def repeat() -> None:
        while not over.wait(period_s):
            act()

    thread = threading.Thread(target=repeat)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
