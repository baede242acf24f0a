"""A wire or a radio between a host's port and a board's, which can be pulled and plugged in again.

A byte arrives as a UART would read it: when the two ends run at different rates, as another one.
"""

import os
import select
import termios
import threading
import tty
from contextlib import suppress
from pathlib import Path

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder
from tests.support.background import BackgroundDevice

RATES = {getattr(termios, f"B{rate}"): rate for rate in (9600, 19200, 38400, 57600, 115200)}


def read_at(rate: int, data: bytes, sent_at: int) -> bytes:
    """What a UART at `rate` makes of `data` sent back to back at another rate."""
    if rate == sent_at:
        return data
    levels = [level for byte in data for level in (0, *((byte >> i) & 1 for i in range(8)), 1)]
    length = sent_at / rate  # of one of the reader's bits, in the sender's

    def level(at: float) -> int:
        place = int(at)
        return levels[place] if place < len(levels) else 1

    got, at = bytearray(), 0.0
    while at < len(levels):
        if level(at):  # no start bit yet; a reader looks 16 times a bit
            at += length / 16
            continue
        bits = [level(at + (n + 1.5) * length) for n in range(8)]
        if level(at + 9.5 * length):  # a stop bit, else it is a framing error, and dropped
            got.append(sum(bit << n for n, bit in enumerate(bits)))
        at += 9.5 * length
    return bytes(got)


class SerialWire(BackgroundDevice):
    """`name` is the port for the host. `rate` is what the board's end runs at, None for any.

    `to_board` has all that the host has sent since it was plugged in last.
    """

    def __init__(self, port: str, name: Path, rate: int | None = None) -> None:
        self.name, self.rate = name, rate
        self.board = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.board)
        self.lock = threading.Lock()
        self.ends: tuple[int, int] | None = None  # host side and device of the pseudo-terminal
        self.decoder: FrameDecoder | None = None
        self.plug()
        self.begin()

    def plug(self) -> None:
        """Connect it; the port appears."""
        with self.lock:
            master, slave = os.openpty()
            tty.setraw(slave)
            os.set_blocking(master, False)
            self.ends, self.to_board = (master, slave), b""
            self.name.symlink_to(os.ttyname(slave))

    def follow(self, rate: int) -> None:
        """The board will run at `rate` once it has taken settings."""
        self.decoder, self.settled_rate = FrameDecoder(), rate

    def pull(self) -> None:
        """Cut it; the port vanishes, and whoever has it open is hung up on."""
        with self.lock:
            self.name.unlink()
            for end in self.ends or ():
                os.close(end)
            self.ends = None

    def let_go(self) -> None:
        if self.ends:
            self.pull()
        os.close(self.board)

    def host_rate(self) -> int:
        """The rate to which the host has set its port."""
        assert self.ends is not None
        return RATES[termios.tcgetattr(self.ends[0])[4]]

    def live(self) -> None:
        while not self.over.is_set():
            select.select([self.board], [], [], 0.002)
            with self.lock:
                self._carry_once()

    def _carry_once(self) -> None:
        up = read_available(self.board)
        if self.ends is None:
            return
        down = read_available(self.ends[0])
        self.to_board += down
        host = self.host_rate()
        rate = self.rate or host
        _write(self.board, read_at(rate, down, host))
        _write(self.ends[0], read_at(host, up, rate))
        if self.decoder is not None and any(map(_taken, self.decoder.feed(up))):
            self.rate, self.decoder = self.settled_rate, None


def _taken(frame: object) -> bool:
    return isinstance(frame, frames.AnswerFrame) and frame.refusal == 0


def _write(file: int, data: bytes) -> None:
    with suppress(BlockingIOError):  # no reader there: what is sent is lost, as on a real line
        os.write(file, data)


def read_available(file: int) -> bytes:
    """What can be read at once from `file`."""
    try:
        return os.read(file, 4096)
    except BlockingIOError:
        return b""
