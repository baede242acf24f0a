"""Standard streams that the caller closed, as in `diffbotctl run goal >&-`."""

from __future__ import annotations

import os
import sys

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
