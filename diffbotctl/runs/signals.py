"""Signals as a readable file: the engine handles them between two instants, never inside one."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

CAUSES = {
    signal.SIGINT: "interrupted (Ctrl-C)",
    signal.SIGTERM: "asked to end (SIGTERM)",
    signal.SIGHUP: "the terminal was closed (SIGHUP)",
    signal.SIGQUIT: "interrupted (Ctrl-\\)",
}


class Signals:
    """Catches the signals that end a program: `file` becomes readable, `cause` names the signal.

    A second SIGQUIT ends the process at once, also when a block hangs.
    """

    def __init__(self) -> None:
        self.file, self._write_end = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self.cause: str | None = None
        for number in CAUSES:
            signal.signal(number, self._on_signal)
        signal.set_wakeup_fd(self._write_end, warn_on_full_buffer=False)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.cause = CAUSES[signal.Signals(number)]
        if number == signal.SIGQUIT:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def signals_as_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt for the signals that would end the process without cleaning up.

    A second SIGQUIT ends it at once.
    """

    def interrupt(number: int, frame: FrameType | None) -> None:
        if number == signal.SIGQUIT:
            signal.signal(number, signal.SIG_DFL)
        raise KeyboardInterrupt

    before = {number: signal.signal(number, interrupt) for number in CAUSES}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
