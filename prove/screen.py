"""A terminal whose output is discarded: `python -m prove.screen COLUMNS LINES COMMAND...`."""

from __future__ import annotations

import os
import re
import struct
import sys
import time
from fcntl import ioctl
from select import select
from termios import TIOCSWINSZ

from tests.support.command_process import start_on_terminal

QUESTION = b"\x1b[6n"
ESCAPES = re.compile(rb"\x1b\[[0-9;?<>=]*[A-Za-z]")


class Drain:
    """Runs a command on a pseudo-terminal, answers queries of the cursor, discards the output."""

    def __init__(self, columns: int, lines: int, words: list[str], environment: dict[str, str]):
        self.master, slave = os.openpty()
        ioctl(self.master, TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        removed = ("TMUX", "STY", "COLUMNS", "LINES")
        kept = {name: value for name, value in environment.items() if name not in removed}
        self.process = start_on_terminal(words, slave, {**kept, "TERM": "xterm-256color"})
        os.close(slave)

    def read(self, seconds: float) -> bytes:
        """The first piece of output within `seconds`; empty when there is none."""
        if not select([self.master], [], [], seconds)[0]:
            return b""
        try:
            data = os.read(self.master, 1 << 16)
        except OSError:
            return b""
        if QUESTION in data:
            os.write(self.master, b"\x1b[1;1R" * data.count(QUESTION))
        return data

    def until(self, text: bytes, timeout: float) -> float:
        """Seconds until `text` is on the screen. Raises TimeoutError after `timeout` seconds."""
        began, output = time.perf_counter(), b""
        while text not in ESCAPES.sub(b"", output):
            output += self.read(0.01)
            if time.perf_counter() - began > timeout:
                shown = ESCAPES.sub(b"", output)[-500:]
                raise TimeoutError(f"{text!r} did not appear; the end of the output: {shown!r}")
        return time.perf_counter() - began

    def read_for(self, seconds: float) -> None:
        """Read and discard the output for `seconds`."""
        end = time.perf_counter() + seconds
        while (remaining := end - time.perf_counter()) > 0:
            self.read(remaining)

    def close(self) -> None:
        """End the command."""
        self.process.kill()
        self.process.wait()
        os.close(self.master)


if __name__ == "__main__":
    drain = Drain(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:], dict(os.environ))
    while drain.process.poll() is None:
        drain.read(1.0)
