"""A serial line that damages some of the messages of a programmer or of its bootloader."""

from __future__ import annotations

import os
import select
import termios
import tty

from tests.support.background import BackgroundDevice


class LossyLine(BackgroundDevice):
    """`name` is the host's port; `device` the one of the board, which is opened, and so reset.

    One bit is wrong in each `to_board` and `to_host` bytes (0: none). After `cut_after` bytes to
    the board nothing arrives there any more.
    """

    def __init__(
        self, device: str, to_board: int = 0, to_host: int = 0, cut_after: int | None = None
    ) -> None:
        self.board = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.board)
        settings = termios.tcgetattr(self.board)
        settings[4] = settings[5] = termios.B115200  # input and output rate, as the board has it
        termios.tcsetattr(self.board, termios.TCSANOW, settings)
        self.host, slave = os.openpty()
        tty.setraw(slave)
        self.slave, self.name = slave, os.ttyname(slave)
        os.set_blocking(self.host, False)
        self.periods = {self.host: to_board, self.board: to_host}
        self.carried = {self.host: 0, self.board: 0}
        self.cut_after = cut_after
        self.begin()

    def live(self) -> None:
        """Pass data on until the end."""
        other = {self.host: self.board, self.board: self.host}
        while not self.over.is_set():
            for end in select.select([self.host, self.board], [], [], 0.02)[0]:
                arrived = self._damaged(end, os.read(end, 4096))
                while arrived:
                    select.select([], [other[end]], [], 1.0)
                    arrived = arrived[os.write(other[end], arrived) :]

    def _damaged(self, end: int, data: bytes) -> bytes:
        before, period = self.carried[end], self.periods[end]
        self.carried[end] += len(data)
        if end == self.host and self.cut_after is not None and before > self.cut_after:
            return b""
        if not period:
            return data
        return bytes(
            byte ^ (0x10 if (before + place) % period == period - 1 else 0)
            for place, byte in enumerate(data)
        )

    def let_go(self) -> None:
        """Close all ends."""
        for file in (self.board, self.host, self.slave):
            os.close(file)
