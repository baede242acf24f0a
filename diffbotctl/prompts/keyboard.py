"""The keyboard of a terminal, where any key stops the robot while it moves."""

from __future__ import annotations

import os
import select
import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress

READ_BYTES = 64  # more than any key sends


class Keyboard:
    """The terminal with the file descriptor `file`."""

    def __init__(self, file: int) -> None:
        self.file = file
        self._cause: str | None = None
        self._normal = termios.tcgetattr(file)

    @property
    def cause(self) -> str | None:
        """Why to stop: a key was pressed. None if none was."""
        if self._cause is None and select.select([self.file], [], [], 0)[0]:
            with suppress(OSError):
                os.read(self.file, READ_BYTES)
            self._cause = "a key was pressed"
        return self._cause

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Detect single keys; what was typed before is discarded."""
        self._cause = None
        single = termios.tcgetattr(self.file)
        single[3] &= ~(termios.ICANON | termios.ECHO)  # local modes; signals remain enabled
        termios.tcsetattr(self.file, termios.TCSAFLUSH, single)
        try:
            yield
        finally:
            termios.tcsetattr(self.file, termios.TCSAFLUSH, self._normal)

    @contextmanager
    def resting(self) -> Iterator[None]:
        """Normal line input, within `watching`."""
        single = termios.tcgetattr(self.file)
        termios.tcsetattr(self.file, termios.TCSAFLUSH, self._normal)
        try:
            yield
        finally:
            self._cause = None
            termios.tcsetattr(self.file, termios.TCSAFLUSH, single)
