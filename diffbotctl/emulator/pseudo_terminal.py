"""A pseudo-terminal as the serial line of an emulated board."""

from __future__ import annotations

import os
import select
import termios
import tty
from contextlib import suppress

READ_MAX = 4096  # bytes of one reading; a board's line carries 12 in a millisecond

OUTPUT_SPEED = 5  # index in what tcgetattr returns
BAUDS = {
    value: int(name[1:])
    for name, value in vars(termios).items()
    if name[0] == "B" and name[1:].isdecimal()
}


class PseudoTerminal:
    """The board's end of a serial line; `name` is the device of the other end."""

    def __init__(self) -> None:
        self._board, self._host = os.openpty()
        tty.setraw(self._host)  # kept open here, so that it stays so when the last client closes
        os.set_blocking(self._board, False)
        self.name = os.ttyname(self._host)

    def read(self) -> bytes:
        """What clients have written since the last call."""
        try:
            return os.read(self._board, READ_MAX)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        """Send to the clients; what does not fit is lost, as without a client."""
        with suppress(BlockingIOError):
            os.write(self._board, data)

    def close(self) -> None:
        """End the line: a client reads its end."""
        os.close(self._board)
        os.close(self._host)


class UsbTerminal(PseudoTerminal):
    """The USB port of a board, which receives each opening and closing and the line rate."""

    def __init__(self) -> None:
        super().__init__()
        os.close(self._host)  # otherwise it would never be seen closed
        self._host = -1
        self.is_open = True  # the first call of `changed` reports that it is not
        self.baud = BAUDS.get(termios.tcgetattr(self._board)[OUTPUT_SPEED], 0)
        self._poll = select.poll()
        self._poll.register(self._board, 0)

    def changed(self) -> bool:
        """Whether a client has opened or closed it, or has changed its rate, since the last call.

        The rate stays after the last client has closed it. If a client has opened, set to
        another rate and closed the port since the last call, the port is reported as open, and by
        the next call as closed.
        """
        before = self.baud, self.is_open
        self.baud = BAUDS.get(termios.tcgetattr(self._board)[OUTPUT_SPEED], self.baud)
        self.is_open = not self._poll.poll(0) or self.baud != before[0]
        return (self.baud, self.is_open) != before

    def read(self) -> bytes:
        """What clients have written since the last call."""
        try:
            return super().read()
        except OSError:  # no client
            return b""

    def close(self) -> None:
        """End the line: a client reads its end."""
        os.close(self._board)
