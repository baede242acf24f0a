"""Any key as a stop: the terminal hands over single keys while something moves."""

from __future__ import annotations

import os
import select
import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress

KEYS = 64  # bytes read at once: more than any key sends


class Keyboard:
    """The terminal behind file `file`, which is a terminal. `cause` is set once a key came."""

    def __init__(self, file: int) -> None:
        self.file = file
        self._cause: str | None = None
        self._usual = termios.tcgetattr(file)

    @property
    def cause(self) -> str | None:
        """Why to stop: a key was pressed since the last look of a person at the terminal."""
        if self._cause is None and select.select([self.file], [], [], 0)[0]:
            with suppress(OSError):
                os.read(self.file, KEYS)
            self._cause = "a key was pressed"
        return self._cause

    @contextmanager
    def watching(self) -> Iterator[None]:
        """While it lasts any key counts; what was typed before does not."""
        self._cause = None
        single = termios.tcgetattr(self.file)
        single[3] &= ~(termios.ICANON | termios.ECHO)  # local modes; signals stay as they are
        termios.tcsetattr(self.file, termios.TCSAFLUSH, single)
        try:
            yield
        finally:
            termios.tcsetattr(self.file, termios.TCSAFLUSH, self._usual)

    @contextmanager
    def resting(self) -> Iterator[None]:
        """While it lasts lines are typed as usual, within `watching`."""
        now = termios.tcgetattr(self.file)
        termios.tcsetattr(self.file, termios.TCSAFLUSH, self._usual)
        try:
            yield
        finally:
            self._cause = None
            termios.tcsetattr(self.file, termios.TCSAFLUSH, now)
