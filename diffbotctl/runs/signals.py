"""Signals as a file to wait for: the loop hears of them between two instants, never inside one."""

from __future__ import annotations

import os
import signal
from types import FrameType

ENDING = {
    signal.SIGINT: "interrupted (Ctrl-C)",
    signal.SIGTERM: "asked to end (SIGTERM)",
    signal.SIGHUP: "the terminal was closed (SIGHUP)",
}


class Signals:
    """Catches what ends a program: `file` becomes readable, and `cause` says what it was."""

    def __init__(self) -> None:
        self.file, self._write = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self.cause: str | None = None
        for number in ENDING:
            signal.signal(number, self._note)
        signal.set_wakeup_fd(self._write, warn_on_full_buffer=False)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.cause = ENDING[signal.Signals(number)]
