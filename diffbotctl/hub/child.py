"""What a forked child lets go of: the engine's files and signals, and its place in the queue."""

from __future__ import annotations

import os
import signal
from contextlib import suppress


def stand_alone(kept: set[int], niceness: int) -> None:
    """Let go of every file but `kept` and the standard ones, so that their ends show to others.

    Signals that end the engine are ignored: a child ends when the engine says that it is over.
    """
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    nowhere = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    for name in os.listdir("/proc/self/fd"):
        file = int(name)
        if file > 2 and file not in kept | {nowhere}:
            with suppress(OSError):  # not closed: objects that still name it must hit nothing else
                os.dup2(nowhere, file, inheritable=False)
    with suppress(OSError):
        os.nice(niceness)
