"""A child process of the engine: how it is forked, and what it lets go of."""

from __future__ import annotations

import gc
import os
import signal
import socket
from collections.abc import Callable
from contextlib import suppress

BUFFER = 4 << 20  # bytes of socket buffer: seconds of a fast run


def fork(live: Callable[[], int]) -> int:
    """Fork a child that runs `live` until it returns its exit code. Returns the pid.

    It is deaf to the signals that end the engine: the engine says when it is over.
    """
    gc.freeze()  # a collection that walks what both share would make each a copy of its own
    pid = os.fork()
    if pid:
        return pid
    code = 1
    try:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        signal.set_wakeup_fd(-1)
        code = live()
    finally:
        os._exit(code)


def fork_with_channel(
    serve: Callable[[socket.socket], int], packets: bool = False, buffer: int | None = BUFFER
) -> tuple[socket.socket, int]:
    """Fork a child that runs `serve` on its end of a channel. Returns the other end, and the pid.

    `packets` arrive whole, other bytes as a stream; `buffer`: bytes that may be on their way, the
    system's choice for None.
    """
    kind = socket.SOCK_SEQPACKET if packets else socket.SOCK_STREAM
    ours, theirs = socket.socketpair(socket.AF_UNIX, kind)
    if buffer is not None:
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, buffer)

    def live() -> int:
        ours.close()
        return serve(theirs)

    pid = fork(live)
    theirs.close()
    return ours, pid


def close_inherited_files(kept: set[int], niceness: int) -> None:
    """Let go of every file but `kept` and the standard ones, so that their ends show to others."""
    nowhere = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    for name in os.listdir("/proc/self/fd"):
        file = int(name)
        if file > 2 and file not in kept | {nowhere}:
            with suppress(OSError):  # not closed: objects that still name it must hit nothing else
                os.dup2(nowhere, file, inheritable=False)
    with suppress(OSError):
        os.nice(niceness)
