"""Standard streams: those that the caller closed, and messages that are written without waiting."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from stat import S_ISCHR, S_ISFIFO

import click

from diffbotctl.printable import fold_line, printable

NAMES = ("stdin", "stdout", "stderr")  # of the descriptors 0, 1 and 2


def open_closed_streams() -> None:
    """Open /dev/null in place of each standard stream that is closed.

    The next file that is opened would get its descriptor. If that were the port of the board, what
    a child process prints would reach the board.
    """
    for descriptor, name in enumerate(NAMES):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free descriptor, which is this one
            os.set_inheritable(descriptor, True)
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            # Open until the process ends, as the stream that it replaces.
            stream = open(descriptor, mode, encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)


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
        columns = getattr(sys.stderr, "columns", None)
        shown = printable(text)
        if columns is not None:
            shown = "\n".join(fold_line(line, columns) for line in shown.split("\n"))
        self._unwritten += f"{shown}\n".encode(errors="replace")
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
