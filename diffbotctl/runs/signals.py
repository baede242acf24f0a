"""Signals as a readable file: the engine handles them between two instants, never inside one."""

from __future__ import annotations

import os
import signal
from types import FrameType

CAUSES = {
    signal.SIGINT: "interrupted (Ctrl-C)",
    signal.SIGTERM: "asked to end (SIGTERM)",
    signal.SIGHUP: "the terminal was closed (SIGHUP)",
}


class Signals:
    """Catches the signals that end a program: `file` becomes readable, `cause` names the signal."""

    def __init__(self) -> None:
        self.file, self._write_end = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self.cause: str | None = None
        for number in CAUSES:
            signal.signal(number, self._on_signal)
        signal.set_wakeup_fd(self._write_end, warn_on_full_buffer=False)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.cause = CAUSES[signal.Signals(number)]
