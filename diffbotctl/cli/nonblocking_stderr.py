"""Messages to the terminal while the robot drives: written at once or later, without waiting.

A terminal accepts nothing more after Ctrl-S, or when its ssh hangs. A program that writes to it
then blocks, and a control path that blocks commands nothing.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from stat import S_ISCHR, S_ISFIFO

import click

from diffbotctl.printable import printable

FLAGS = os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC


class NonBlockingStderr:
    """Writes lines to standard error without waiting; the rest of them at the end."""

    def __init__(self) -> None:
        self._unwritten = b""
        self._file: int | None = None

    def say(self, text: str) -> None:
        """A line, as much of it as is taken now."""
        file = self._opened()
        if file is None:
            click.echo(text, err=True)
            return
        self._unwritten += f"{printable(text)}\n".encode(errors="replace")
        with suppress(OSError):
            self._unwritten = self._unwritten[os.write(file, self._unwritten) :]

    def end(self) -> None:
        """The robot stands: write the rest, however long that takes."""
        if self._unwritten:
            click.echo(self._unwritten, nl=False, err=True)
        if self._file is not None:
            os.close(self._file)
        self._unwritten, self._file = b"", None

    def _opened(self) -> int | None:
        """Standard error, opened anew: not to wait is a property of our own opening alone.

        None for what is no terminal and no pipe: a file on a disk takes all.
        """
        if self._file is None:
            with suppress(OSError, ValueError, AttributeError):  # a socket, or none at all
                given = sys.stderr.fileno()
                kind = os.fstat(given).st_mode
                if S_ISCHR(kind) or S_ISFIFO(kind):
                    self._file = os.open(f"/proc/self/fd/{given}", FLAGS)
        return self._file
