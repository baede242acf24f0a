"""A screen in a process of its own: it can never slow the engine. One that only shows is idle."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import suppress

from diffbotctl.hub.latest import Snapshot

NICENESS = 2  # the control path goes first; a lost word of whoever drives would stop the robot
LARGEST = 1 << 18  # bytes of one picture
LINES = 64 << 10  # bytes the channel may hold: a few pictures, older ones are of no use


def start(
    show: Callable[[Iterator[Snapshot]], None], drives: bool = False
) -> tuple[socket.socket, int]:
    """Fork a process that runs `show` over the pictures sent to the returned channel.

    One that `drives` as well handles its signals itself, and gets its share of the processor.
    """
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    gc.freeze()  # as for the hub: what is not walked stays shared
    pid = os.fork()
    if pid:
        theirs.close()
        return ours, pid
    ours.close()
    try:
        signal.set_wakeup_fd(-1)
        _alert() if drives else _quiet()
        show(_pictures(theirs))
    except BrokenPipeError:
        pass
    finally:
        os._exit(0)


def _quiet() -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # the engine says when it is over
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def _alert() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # its terminal is raw: Ctrl-C is a key
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
