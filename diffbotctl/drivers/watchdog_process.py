"""A watchdog: a small process that stops a board which cannot stop by itself.

A board with the book's firmware keeps its motors running when the host falls silent. The watchdog
also holds the port and the frames that stop this board. When the engine's process dies (the channel
ends without an exit message) it sends them repeatedly, and then exits.
"""

from __future__ import annotations

import os
import signal
import socket
import termios
import time
from contextlib import suppress

STOP_REPEATS = 40  # a stock board loses a quarter of single frames: 0.25**40 is 1e-24
STOP_PERIOD_S = 0.05  # 9600 baud carries a stop frame in less
MESSAGE_MAX_BYTES = 4096
# Kinds of messages on the channel, by their first byte.
PORT, STOP_FRAME, EXIT = b"P", b"S", b"B"


class WatchdogProcess:
    """The engine's end. It sends the watchdog the port and the frames that stop the board."""

    def __init__(self) -> None:
        self.channel, child_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.stop_frame = b""
        self.pid = os.fork()
        if self.pid == 0:
            self.channel.close()
            try:
                _watch(child_end)
            finally:
                os._exit(0)
        child_end.close()
        self.channel.setblocking(False)

    def set_port(self, fd: int) -> None:
        """Hand over a newly opened port; the stop frame of the one before is no longer valid."""
        self.stop_frame = b""
        with suppress(OSError):
            socket.send_fds(self.channel, [PORT], [fd])

    def set_stop_frame(self, frame: bytes) -> None:
        """Set the bytes that stop the board; unchanged ones are not sent again."""
        if frame != self.stop_frame:
            self.stop_frame = frame
            with suppress(OSError):
                self.channel.send(STOP_FRAME + frame)

    def exit(self) -> None:
        """End the watchdog process without sending a stop."""
        with suppress(OSError):
            self.channel.send(EXIT)
        self.channel.close()
        os.waitpid(self.pid, 0)


def _watch(channel: socket.socket) -> None:
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    port, stop_frame = -1, b""
    while True:
        try:
            message, fds, _, _ = socket.recv_fds(channel, MESSAGE_MAX_BYTES, 1)
        except ConnectionResetError:
            message, fds = b"", []
        kind = message[:1]
        if kind == EXIT:
            return
        if not message:
            _stop(port, stop_frame)
            return
        if kind == PORT:
            if port >= 0:
                os.close(port)
            port, stop_frame = fds[0], b""
        elif kind == STOP_FRAME:
            stop_frame = message[1:]


def _stop(port: int, stop_frame: bytes) -> None:
    """Send the stop frame repeatedly, ahead of anything that waits."""
    if port < 0 or not stop_frame:
        return
    with suppress(termios.error):
        termios.tcflush(port, termios.TCOFLUSH)
    for _ in range(STOP_REPEATS):
        with suppress(OSError):
            os.write(port, stop_frame)
        time.sleep(STOP_PERIOD_S)
