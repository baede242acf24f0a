"""A watchdog: a small process that stops a board which cannot stop by itself.

A board with the book's firmware keeps its motors running when the host falls silent. The watchdog
also holds the port, and knows the frames that stop this board. The engine's loop sends it a
heartbeat with each access to the port. When the heartbeats of a moving robot stop, because the
engine's process is suspended or its loop hangs, or when the process has died (the channel ends
without an exit message), the watchdog discards what waits in the port, brings the board's parser
back to the start of a frame and sends stops: to a suspended engine until it has confirmed that it
runs again, and after its death until the counts show standstill.

It cannot stop a board behind a cut cable or radio, nor on a machine that is off or asleep.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import termios
import time
from collections.abc import Callable
from contextlib import suppress

from diffbotctl.errors import Problem, RunError
from diffbotctl.links.rosserial_stop import WRITTEN_BYTES_MAX, StandstillDetector, StopOrder, filler
from diffbotctl.processes.child_process import (
    close_inherited_files,
    fork_with_channel,
    wait_for_exit,
)
from diffbotctl.processes.real_time import prefer
from diffbotctl.time import MILLISECOND, SECOND

HEARTBEAT_PERIOD = 40 * MILLISECOND
# As long as the gate waits for telemetry. The filler and four pairs of stops, of which a board
# obeys at least one, take 0.2 s of the half second in which the motors have to be off.
HEARTBEAT_TIMEOUT = 250 * MILLISECOND
UNANSWERED_MAX = 25  # heartbeats, one second: then the watchdog has died or is suspended itself
STOP_PERIOD = 45 * MILLISECOND  # 9600 baud carries the pair of stops in 25 ms
STOP_REPEATS_MIN = 20  # a stock board loses a quarter of single frames: 0.25**20 is 1e-12
STOP_TIME_MAX = 60 * SECOND  # after the engine's death, without a sign of standstill
EXIT_TIMEOUT_S = 1.0  # then the process is killed
MESSAGE_MAX_BYTES = 4096
NICENESS = -10  # only root may; a stop must not wait behind other programs
STOPPED_TEXT = "diffbotctl has died; its watchdog process has stopped the robot"
LOOK_TEXT = "diffbotctl has died, and {}: look at the robot, and switch the motor battery off"
PORT_GONE, NO_STANDSTILL = (
    "its watchdog process lost the port",
    "after a minute of stops from its watchdog process the robot has not reported standstill",
)
# Kinds of messages, by their first byte: from the engine,
PORT, ORDER, HEARTBEAT, RELEASE, EXIT = b"P", b"S", b"H", b"R", b"X"
MOVING = b"M"  # second byte of a heartbeat of a robot that may move
# and from the watchdog.
ANSWER, INTERVENED = b"A", b"I"


def watchdog_lost(cause: str) -> RunError:
    """The error for a robot that nothing would stop if the host died."""
    fix = "the robot was stopped; run again, and end no process of diffbotctl by hand"
    return RunError(Problem("E-WATCHDOG", "watchdog process", cause, fix))


class WatchdogProcess:
    """The engine's end.

    `intervened`: the watchdog has stopped the robot, because there were no heartbeats; it goes on
    until `release`; `gap` is the time in ns without heartbeats, as far as it is known. `lost` is
    the reason why the watchdog does not watch any more, else "".
    """

    def __init__(self) -> None:
        self.channel, self.pid = fork_with_channel(_serve, packets=True, buffer=None)
        self.channel.setblocking(False)
        self.order: StopOrder | None = None
        self.is_moving = False
        self.intervened = False
        self.lost = ""
        self.unanswered = 0
        self.sent_at = self.gap = 0

    def set_port(self, fd: int) -> None:
        """Hand over a newly opened port; the order for the one before is no longer valid."""
        self.order = None
        with suppress(OSError):
            socket.send_fds(self.channel, [PORT], [fd])

    def report(self, order: StopOrder | None, is_moving: bool, written: bytes) -> None:
        """Send a heartbeat when one is due, and before the robot begins to move.

        `written`: the last bytes to the board, with those about to be written.
        """
        now = time.monotonic_ns()
        if order is not None and order != self.order:
            self.order = order
            self._send(ORDER + order.pack())
        if is_moving == self.is_moving and now - self.sent_at < HEARTBEAT_PERIOD:
            return
        self.is_moving, self.sent_at = is_moving, now
        self.unanswered += 1
        state = MOVING if is_moving else b"-"
        self._send(HEARTBEAT + state + written[-WRITTEN_BYTES_MAX:])

    def poll(self) -> None:
        """Update `intervened` and `lost` from what the watchdog has sent."""
        while not self.lost:
            try:
                message = self.channel.recv(MESSAGE_MAX_BYTES)
            except BlockingIOError:
                break
            except OSError:
                message = b""
            if not message:
                self.lost = "it was killed, and nothing else would stop this board"
            elif message == INTERVENED:
                self.intervened, self.gap = True, time.monotonic_ns() - self.sent_at
            else:
                self.unanswered = 0
        if self.unanswered > UNANSWERED_MAX and not self.lost:
            self.lost = "it does not answer, and nothing else would stop this board"

    def release(self) -> None:
        """End an intervention: the engine runs, and has stopped the robot itself."""
        self.intervened = False
        self._send(RELEASE)

    def exit(self) -> None:
        """End the watchdog process without sending a stop."""
        self._send(EXIT)
        self.channel.close()
        wait_for_exit(self.pid, EXIT_TIMEOUT_S)

    def _send(self, message: bytes) -> None:
        with suppress(OSError):
            self.channel.send(message)


def _serve(channel: socket.socket) -> int:
    # A session of its own: Ctrl-Z and signals to the engine's process group do not reach it.
    with suppress(OSError):
        os.setsid()
    for number in (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU):
        signal.signal(number, signal.SIG_IGN)
    with suppress(OSError):
        os.nice(NICENESS)
    prefer()
    close_inherited_files({channel.fileno()}, 0)
    _Watch(channel).run()
    return 0


class _Watch:
    """The watchdog's own end: what it knows of the board, and when the engine last reported."""

    def __init__(self, channel: socket.socket) -> None:
        self.channel = channel
        self.port: int | None = None
        self.order: StopOrder | None = None
        self.is_moving = False
        self.written = b""  # by the engine, the last bytes
        self.unsent = b""  # rest of a write of this process
        self.heartbeat_at = 0
        self.is_intervening = False
        self.is_over = self.is_dead = False
        self.poll = select.poll()
        self.poll.register(channel, select.POLLIN)

    def run(self) -> None:
        """Watch until the engine ends; stop the robot when it does not run."""
        while not self.is_over:
            if self.poll.poll(self._wait_ms()):
                self._receive()
            elif self.is_intervening:
                self._send_stop()
            elif self.is_moving and time.monotonic_ns() - self.heartbeat_at >= HEARTBEAT_TIMEOUT:
                self._intervene()
        if self.is_dead and self.order is not None and self.port is not None:
            _print(self._stop_for_good(self.order, self.port))

    def _wait_ms(self) -> int | None:
        """Time until the next action, rounded up; None when only the engine can cause one."""
        if self.is_intervening:
            return STOP_PERIOD // MILLISECOND
        if not self.is_moving:
            return None
        remaining = self.heartbeat_at + HEARTBEAT_TIMEOUT - time.monotonic_ns()
        return max(0, -(-remaining // MILLISECOND))

    def _receive(self) -> None:
        try:
            message, fds, _, _ = socket.recv_fds(self.channel, MESSAGE_MAX_BYTES, 1)
        except ConnectionResetError:
            message, fds = b"", []
        kind, body = message[:1], message[1:]
        if kind in (EXIT, b""):
            self.is_over, self.is_dead = True, not kind
        elif kind == PORT:
            if self.port is not None:
                os.close(self.port)
            self.port, self.order, self.is_intervening = fds[0], None, False
        elif kind == ORDER:
            self.order = StopOrder.unpack(body)
        elif kind == RELEASE:
            self.is_intervening = False
        else:
            self.heartbeat_at = time.monotonic_ns()
            self.is_moving, self.written = body[:1] == MOVING, body[1:]
            self._tell(ANSWER)

    def _intervene(self) -> None:
        self.is_moving, self.is_intervening = False, True
        self._tell(INTERVENED)
        self._take_port()

    def _take_port(self) -> None:
        """Discard what waits, and end the frame that it began."""
        if self.port is None or self.order is None:
            return
        with suppress(termios.error):  # a radio's socket cannot be flushed
            termios.tcflush(self.port, termios.TCOFLUSH)
        self.unsent = b""
        self._write(filler(self.written) + self.order.frames)

    def _send_stop(self) -> None:
        if self.order is not None:
            self._write(self.order.frames)

    def _write(self, data: bytes) -> None:
        """Write what the port accepts of `data`, or first of the rest of the last write."""
        data = self.unsent or data
        with suppress(OSError):
            if self.port is not None:
                self.unsent = data[os.write(self.port, data) :]

    def _stop_for_good(self, order: StopOrder, port: int) -> str:
        """After the engine's death: stop until the wheels stand. Returns what came of it."""
        self._take_port()
        standstill, begin = StandstillDetector(order), time.monotonic_ns()
        while time.monotonic_ns() - begin < STOP_TIME_MAX:
            next_stop = time.monotonic_ns() + STOP_PERIOD
            while (remaining := next_stop - time.monotonic_ns()) > 0:
                if not _read_into(standstill.receive, port, remaining):
                    return LOOK_TEXT.format(PORT_GONE)  # and with it every way to the board
            if standstill.stands and time.monotonic_ns() - begin >= STOP_REPEATS_MIN * STOP_PERIOD:
                return STOPPED_TEXT
            self._write(order.frames)
        return LOOK_TEXT.format(NO_STANDSTILL)

    def _tell(self, message: bytes) -> None:
        with suppress(OSError):
            self.channel.send(message, socket.MSG_DONTWAIT)


def _print(text: str) -> None:
    """Print a line for the user of an engine that cannot any more."""
    with suppress(OSError):
        os.write(2, f"\n{text}\n".encode())  # below the live view


def _read_into(receive: Callable[[int, bytes], None], port: int, timeout: int) -> bool:
    """Pass on what arrives within `timeout` ns; False when the port has disconnected."""
    if not select.select([port], [], [], timeout / SECOND)[0]:
        return True
    try:
        data = os.read(port, MESSAGE_MAX_BYTES)
    except BlockingIOError:
        return True
    except OSError:
        return False
    receive(time.monotonic_ns(), data)
    return bool(data)
