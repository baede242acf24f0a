"""A screen in a process of its own: it can never slow the engine. One that only shows is idle."""

from __future__ import annotations

import os
import pickle
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import suppress

from diffbotctl.hub.child import fork_with_channel
from diffbotctl.hub.latest import Snapshot

NICENESS = 2  # the control path goes first; a lost word of whoever drives would stop the robot
LARGEST = 1 << 18  # bytes of one picture


def start(
    show: Callable[[Iterator[Snapshot]], None], drives: bool = False
) -> tuple[socket.socket, int]:
    """Fork a process that runs `show` over the pictures sent to the returned channel.

    One that `drives` as well handles its signals itself, and gets its share of the processor.
    """

    def serve(channel: socket.socket) -> int:
        _alert() if drives else _quiet()
        with suppress(BrokenPipeError):
            show(_pictures(channel))
        return 0

    return fork_with_channel(serve, packets=True, buffer=None)


def _quiet() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def _alert() -> None:
    """SIGINT stays ignored: its terminal is raw, and Ctrl-C is a key."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    with suppress(OSError):
        os.nice(NICENESS)


def _pictures(channel: socket.socket) -> Iterator[Snapshot]:
    """Pictures until the engine ends or dies."""
    while True:
        data = channel.recv(LARGEST)
        if not data:
            return
        picture = pickle.loads(data)
        if picture is None:
            return
        yield picture
