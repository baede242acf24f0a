"""One program as the engine sees it: its socket, what it may send, and when it counts as lost."""

from __future__ import annotations

import socket

from diffbotctl.config.configuration import ProgramUse
from diffbotctl.control_socket.protocol import LineBuffer, RefusalError, parse_line
from diffbotctl.engine.driver import Delivery
from diffbotctl.message_parser import MessageError, message_parser
from diffbotctl.time import NEVER, SECOND

# What is read at once, of one program. One buffer for all: making one for each read takes longer
# than reading a line.
READ_BUFFER = memoryview(bytearray(1 << 16))
LINES_PER_SECOND_MAX = 1000
BYTES_PER_SECOND_MAX = 1 << 20
FIRST_LINE_TIMEOUT = 30 * SECOND  # a program may load a large model
SILENCE_MAX = 2 * SECOND  # or four times its timeout, if that is longer
FLOOD_RATIO = 2 * LINES_PER_SECOND_MAX
SEND_QUEUE_MAX_BYTES = 1 << 16  # that wait for a program which reads slowly


class ProgramLink:
    """One program as the engine sees it. Times are in ns."""

    def __init__(self, use: ProgramUse) -> None:
        self.use = use
        self.outputs = {  # by port: the wire, and what reads its messages
            wire.rpartition(".")[2]: (wire, message_parser(kind))
            for wire, kind in use.outputs.items()
        }
        # A program that publishes rarely sends empty objects meanwhile.
        self.silence_max = max(SILENCE_MAX, round(4 * use.timeout * SECOND))
        self.socket: socket.socket | None = None
        self.pid = 0
        self.who = use.name  # the program as the cause of a stop names it
        self.lines = LineBuffer()
        self.queue = bytearray()  # that waits to be sent
        self.dropped = 0
        self.window = self.window_lines = self.window_bytes = 0
        self.silent_at = NEVER  # when it counts as hanging
        self.lost_at = NEVER  # when its outputs expire, whatever is known of its end
        self.end_text = ""  # how it ended; what it sent before is still read
        self.is_flooding = False  # a fault: what it sends comes FLOOD_RATIO times

    def open(self, now: int, pid: int, file: int) -> None:
        """A new process has been started; `file` is this end of its socket."""
        self.close()
        self.socket, self.pid = socket.socket(fileno=file), pid
        self.who = f"program {self.use.name} (process {pid})"
        self.socket.setblocking(False)
        self.lines, self.queue, self.dropped = LineBuffer(), bytearray(), 0
        self.silent_at = now + FIRST_LINE_TIMEOUT if self.outputs else NEVER
        self.lost_at, self.end_text = NEVER, ""

    def close(self) -> None:
        """Close this end of the socket: the program reads the end of its input."""
        if self.socket is not None:
            self.socket.close()
        self.socket, self.silent_at, self.end_text = None, NEVER, ""

    def read(self, now: int) -> bytes | None:
        """What has come; None when the program has closed its end. Raises RefusalError: a flood."""
        assert self.socket is not None
        try:
            data = READ_BUFFER[: self.socket.recv_into(READ_BUFFER)].tobytes()
        except BlockingIOError:
            return b""
        except OSError:
            return None
        if self.is_flooding:
            data *= FLOOD_RATIO
        if now - self.window > SECOND:
            self.window, self.window_lines, self.window_bytes = now, 0, 0
        self.window_lines += data.count(b"\n")
        self.window_bytes += len(data)
        if self.window_lines > LINES_PER_SECOND_MAX or self.window_bytes > BYTES_PER_SECOND_MAX:
            cause = (
                f"it sent more than {LINES_PER_SECOND_MAX} lines or {BYTES_PER_SECOND_MAX} bytes "
                "in a second"
            )
            raise RefusalError("E-PROGRAM", cause)
        return data or None

    def messages(self, now: int, line: bytes) -> list[Delivery]:
        """The messages in one line, stamped. Raises RefusalError for a line that is invalid."""
        deliveries = []
        for port, values in parse_line(line).items():
            if port not in self.outputs:
                known = ", ".join(self.outputs)
                raise RefusalError("E-PROGRAM", f"there is no output '{port[:40]}'; it has {known}")
            wire, parse = self.outputs[port]
            if not isinstance(values, dict):
                raise RefusalError("E-PROGRAM", f"{port} is not an object")
            if "time" in values:
                cause = f"{port} has a `time` of its own: leave it out, the engine stamps messages"
                raise RefusalError("E-PROGRAM", cause)
            try:
                deliveries.append(Delivery(wire, parse(values, now)))
            except MessageError as error:
                raise RefusalError("E-PROGRAM", f"{port}: {error}") from None
        return deliveries

    def send(self, data: bytes) -> None:
        """Send a line; one that does not fit is dropped and counted."""
        if self.socket is None:
            return
        if len(self.queue) + len(data) > SEND_QUEUE_MAX_BYTES:
            self.dropped += 1
            return
        unsent = self.queue + data if self.queue else data
        try:
            sent = self.socket.send(unsent, socket.MSG_NOSIGNAL)
        except OSError:  # what does not fit waits; that it has ended is read
            sent = 0
        if self.queue or sent < len(data):
            self.queue = bytearray(unsent[sent:])
