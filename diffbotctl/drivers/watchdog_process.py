"""The guardian: a small process that stops a board which cannot stop by itself.

A board with the book's firmware keeps its motors running when the host falls silent. The guardian
holds the port too, and the frames that stop this board; when the engine dies without a word (the
channel ends without a farewell) it sends them, again and again, and then ends.
"""

from __future__ import annotations

import os
import signal
import socket
import termios
import time
from contextlib import suppress

REPEATS = 40  # frames: a stock board loses a quarter of single ones, so this many are sure
PAUSE = 0.05  # s between two: what 9600 baud carries with room to spare
LARGEST = 4096  # bytes of stop frames


class WatchdogProcess:
    """The engine's end. Keep it told of the port and of the frames that stop the board."""

    def __init__(self) -> None:
        self.channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.frames = b""
        self.pid = os.fork()
        if self.pid == 0:
            self.channel.close()
            try:
                _guard(theirs)
            finally:
                os._exit(0)
        theirs.close()
        self.channel.setblocking(False)

    def watch(self, fd: int) -> None:
        """Hand over the newly opened port; the frames of the one before no longer count."""
        self.frames = b""
        with suppress(OSError):
            socket.send_fds(self.channel, [b"P"], [fd])

    def arm(self, frames: bytes) -> None:
        """Say which bytes stop the board; unchanged ones cost nothing."""
        if frames != self.frames:
            self.frames = frames
            with suppress(OSError):
                self.channel.send(b"S" + frames)

    def dismiss(self) -> None:
        """Say farewell: the engine has stopped the robot itself."""
        with suppress(OSError):
            self.channel.send(b"B")
        self.channel.close()
        os.waitpid(self.pid, 0)


def _guard(channel: socket.socket) -> None:
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    port, frames = -1, b""
    while True:
        try:
            said, fds, _, _ = socket.recv_fds(channel, LARGEST, 1)
        except ConnectionResetError:
            said, fds = b"", []
        if said[:1] == b"B":
            return
        if not said:
            _stop(port, frames)
            return
        if said[:1] == b"P":
            if port >= 0:
                os.close(port)
            port, frames = fds[0], b""
        elif said[:1] == b"S":
            frames = said[1:]


def _stop(port: int, frames: bytes) -> None:
    """Put the stop on the wire, repeatedly, in front of anything that waits."""
    if port < 0 or not frames:
        return
    with suppress(termios.error):
        termios.tcflush(port, termios.TCOFLUSH)
    for _ in range(REPEATS):
        with suppress(OSError):
            os.write(port, frames)
        time.sleep(PAUSE)
