"""A terminal for tests: a real pseudo-terminal, and pyte as the screen that answers as xterm's."""

import os
import select
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from fcntl import ioctl
from termios import TIOCSWINSZ
from typing import Any, Self

import pyte

from tests.support.command_process import start_on_terminal

SCREEN_TIMEOUT_S = 60  # s that a test waits for what must come; it fails by itself afterwards


class AnsweringScreen(pyte.Screen):
    """A screen whose reports go back to the program, as a terminal's do."""

    def __init__(self, columns: int, lines: int, answer: Callable[[bytes], None]) -> None:
        super().__init__(columns, lines)
        self.answer = answer
        self.modes: set[int] = set()  # private ones that are on: 1003 mouse, 1049 alternate

    def write_process_input(self, data: str) -> None:
        self.answer(data.encode())

    def set_mode(self, *modes: int, **options: Any) -> None:
        if options.get("private"):
            self.modes.update(modes)
        super().set_mode(*modes, **options)

    def reset_mode(self, *modes: int, **options: Any) -> None:
        if options.get("private"):
            self.modes.difference_update(modes)
        super().reset_mode(*modes, **options)


class Terminal:
    """Runs `command` in a window of `columns` x `lines`. Nothing is read unless a test looks."""

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str] | None = None,
        columns: int = 80,
        lines: int = 24,
        **more: str,
    ) -> None:
        self.master, slave = os.openpty()
        self.is_closed = False
        self._size(columns, lines)
        variables = {**(environment or os.environ), "TERM": "xterm-256color", **more}
        for name in ("TMUX", "STY", "NO_COLOR", "COLUMNS", "LINES"):
            if name not in more:
                variables.pop(name, None)
        self.process = start_on_terminal(command, slave, variables)
        self.slave = slave  # kept open, so that its settings can be read when the program is gone
        self.screen = AnsweringScreen(columns, lines, self._write)
        self.stream = pyte.ByteStream(self.screen)
        self.answers = True

    def _write(self, data: bytes) -> None:
        if self.answers:
            os.write(self.master, data)

    def type(self, text: str | bytes) -> None:
        """Press keys."""
        os.write(self.master, text.encode() if isinstance(text, str) else text)

    def click(self, column: int, row: int, to: tuple[int, int] | None = None) -> None:
        """Press the left button at a place of the screen (from 0) and let go there, or at `to`."""
        end = to or (column, row)
        self.type(f"\x1b[<0;{column + 1};{row + 1}M")
        if to:
            self.type(f"\x1b[<32;{end[0] + 1};{end[1] + 1}M")
        self.type(f"\x1b[<0;{end[0] + 1};{end[1] + 1}m")

    def resize(self, columns: int, lines: int) -> None:
        """Change the window's size."""
        self._size(columns, lines)
        self.screen.resize(lines, columns)

    def look(self, seconds: float = 0.05) -> bool:
        """Draw what comes within so long. False when the program has closed its end."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            if not select.select([self.master], [], [], left)[0]:
                return True
            try:
                data = os.read(self.master, 1 << 16)
            except OSError:
                return False
            self.stream.feed(data)
        return True

    @property
    def text(self) -> str:
        return "\n".join(self.screen.display)

    def until(self, seen: Callable[[str], object], what: str = "what the test waits for") -> str:
        """Look until `seen(text)`; fails with the screen."""
        deadline = time.monotonic() + SCREEN_TIMEOUT_S
        while not seen(self.text):
            self.look()
            if time.monotonic() > deadline:
                raise AssertionError(f"{what} never came; the screen:\n{self.text}")
        return self.text

    def ended(self) -> int:
        """Look until the program has ended, and at all that it wrote; its exit code."""
        deadline = time.monotonic() + SCREEN_TIMEOUT_S
        while self.process.poll() is None:
            self.look()
            assert time.monotonic() < deadline, f"it goes on; the screen:\n{self.text}"
        while select.select([self.master], [], [], 0)[0] and self.look():
            pass
        return self.process.returncode

    def hang_up(self) -> None:
        """Close the window."""
        os.close(self.slave)
        os.close(self.master)
        self.is_closed = True

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        if not self.is_closed:
            self.hang_up()

    def _size(self, columns: int, lines: int) -> None:
        ioctl(self.master, TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
