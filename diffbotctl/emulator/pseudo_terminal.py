"""A pseudo-terminal as the serial line of an emulated board."""

from __future__ import annotations

import os
import tty
from contextlib import suppress

READ_MAX = 4096  # bytes of one reading; a board's line carries 12 in a millisecond


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
