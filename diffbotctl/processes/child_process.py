"""Child processes of the engine: forking, and the channel that must lose nothing.

Over the channel the engine sends length-prefixed pickles with ChildSender; the child reads them
with `read_items`, and reports trouble as plain text with `report`.
"""

from __future__ import annotations

import gc
import os
import pickle
import select
import signal
import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

BUFFER_BYTES = 4 << 20  # of the socket: seconds of a fast run
BACKLOG_MAX_BYTES = 16 << 20  # that may wait for the child; then the channel is given up
SILENCE_PERIOD_S = 0.7  # with what the engine gathers, a power cut costs less than a second
LENGTH = struct.Struct("<I")
ANSWER_TIMEOUT_S = 30.0  # for a writer that the engine waits for: a slow disk, not a suspended one
EXIT_TIMEOUT_S = 10.0  # for a child whose channel has been closed
EXIT_POLL_PERIOD_S = 0.002
NO_ANSWER = "the recorder does not answer"


def fork(run: Callable[[], int]) -> int:
    """Fork a child that runs `run` and exits with the code that it returns. Returns the pid.

    The child ignores SIGINT, SIGQUIT, SIGTERM and SIGHUP; it ends when its channel closes.
    """
    gc.freeze()  # a collection in the child would write to the shared pages and copy them
    pid = os.fork()
    if pid:
        return pid
    code = 1
    try:
        for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        signal.set_wakeup_fd(-1)
        code = run()
    finally:
        os._exit(code)


def fork_with_channel(
    serve: Callable[[socket.socket], int], packets: bool = False, buffer: int | None = BUFFER_BYTES
) -> tuple[socket.socket, int]:
    """Fork a child that runs `serve` on its end of a channel. Returns the other end and the pid.

    `packets`: message boundaries are kept; otherwise the channel is a byte stream. `buffer`: size
    of the send buffer in bytes, None for the system's default.
    """
    kind = socket.SOCK_SEQPACKET if packets else socket.SOCK_STREAM
    ours, theirs = socket.socketpair(socket.AF_UNIX, kind)
    if buffer is not None:
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, buffer)

    def run() -> int:
        ours.close()
        return serve(theirs)

    pid = fork(run)
    theirs.close()
    return ours, pid


def resume(pid: int) -> None:
    """Let a child that was suspended run again, so that it can finish its work."""
    with suppress(OSError):
        os.kill(pid, signal.SIGCONT)


def wait_for_exit(pid: int, timeout: float = EXIT_TIMEOUT_S) -> bool:
    """Wait for a child to exit, and kill it after `timeout` s. True if it exited by itself."""
    deadline = time.monotonic() + timeout
    with suppress(ChildProcessError):
        while os.waitpid(pid, os.WNOHANG) == (0, 0):
            if time.monotonic() > deadline:
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)
                return False
            time.sleep(EXIT_POLL_PERIOD_S)
    return True


def close_inherited_files(kept: set[int], niceness: int) -> None:
    """Close every file but `kept` and the standard ones, and raise the niceness.

    Otherwise the other ends of inherited sockets would not see that the engine has closed them.
    """
    null = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    for name in os.listdir("/proc/self/fd"):
        file = int(name)
        if file > 2 and file not in kept | {null}:
            with suppress(OSError):  # replaced, not closed: inherited objects still use the number
                os.dup2(null, file, inheritable=False)
    with suppress(OSError):
        os.nice(niceness)


class ChildSender:
    """Sends items to a child process, and receives the texts that the child reports.

    `waits`: sending blocks until the child has room, for ANSWER_TIMEOUT_S; otherwise what does not
    fit waits here, up to BACKLOG_MAX_BYTES. `on_loss` is called once, with the reason, when
    something was lost; nothing is sent after that.
    """

    def __init__(self, channel: socket.socket, waits: bool, on_loss: Callable[[str], None]) -> None:
        self.channel = channel
        self.on_loss = on_loss
        self.backlog = bytearray()
        self.lost: str | None = None
        channel.settimeout(ANSWER_TIMEOUT_S if waits else 0.0)

    def send(self, item: Any) -> None:
        """Queue `item` and send as much as the channel accepts."""
        if self.lost is not None:
            return
        body = pickle.dumps(item, pickle.HIGHEST_PROTOCOL)
        self.backlog += LENGTH.pack(len(body)) + body
        try:
            while self.backlog:
                del self.backlog[: self.channel.send(self.backlog)]
        except BlockingIOError:
            if len(self.backlog) > BACKLOG_MAX_BYTES:
                self.give_up("the recorder could not keep up")
        except TimeoutError:
            self.give_up(NO_ANSWER)
        except (BrokenPipeError, ConnectionResetError):
            self.give_up("the recorder has ended")

    def receive(self) -> str | None:
        """The text that the child has reported since the last call, or None. Does not wait.

        A child that has ended counts as a loss.
        """
        if self.lost is not None or not select.select([self.channel], [], [], 0)[0]:
            return None
        data = self._receive()
        if not data and self.lost is None:
            self.give_up("the recorder has ended")
        return data.decode() or None

    def finish(self) -> None:
        self.channel.shutdown(socket.SHUT_WR)

    def close(self) -> str:
        """Wait until the child closes its end. Returns the rest of its reports.

        A child that does not within ANSWER_TIMEOUT_S counts as a loss.
        """
        data = b""
        self.channel.settimeout(ANSWER_TIMEOUT_S)
        try:
            while self.lost is None and (part := self._receive()):
                data += part
        except TimeoutError:
            self.give_up(NO_ANSWER)
        self.channel.close()
        return data.decode()

    def _receive(self) -> bytes:
        try:
            return self.channel.recv(1 << 10)
        except ConnectionResetError:  # it died before it had read everything
            self.give_up("the recorder has ended")
            return b""

    def give_up(self, cause: str) -> None:
        self.lost = cause
        self.backlog.clear()
        self.on_loss(cause)


def read_items(channel: socket.socket) -> Iterator[Any]:
    """Every item from the channel until its end, and None after each SILENCE_PERIOD_S without."""
    buffer = bytearray()
    while True:
        if not select.select([channel], [], [], SILENCE_PERIOD_S)[0]:
            yield None
            continue
        try:
            data = channel.recv(1 << 16)
        except ConnectionResetError:
            return
        if not data:
            return
        buffer += data
        yield from map(pickle.loads, split_frames(buffer))


def split_frames(buffer: bytearray) -> Iterator[bytes]:
    """Remove the complete items from the front of `buffer` and yield them, still pickled."""
    while len(buffer) >= LENGTH.size:
        (length,) = LENGTH.unpack_from(buffer)
        if len(buffer) < LENGTH.size + length:
            return
        yield bytes(buffer[LENGTH.size : LENGTH.size + length])
        del buffer[: LENGTH.size + length]


def drain(channel: socket.socket) -> None:
    """Read until the end of the channel, and drop what comes."""
    with suppress(ConnectionResetError):
        while channel.recv(1 << 16):
            pass


def report(channel: socket.socket, text: str) -> None:
    """Report `text` to the engine; nothing happens if the engine has ended."""
    with suppress(OSError):
        channel.send(text.encode())
