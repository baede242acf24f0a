"""A double of an HC-05 on the board's radio port, as it behaves when its button was held.

After its AT command set: answers end with `OK` or `ERROR:(n)`; without the button it is in data
mode and ignores what it receives.
"""

import os
import select
import tty
from collections.abc import Sequence

from tests.support.background import BackgroundDevice


class Hc05(BackgroundDevice):
    """`at_mode` is what the button does; `rate` what the module would use in data mode."""

    def __init__(
        self,
        port: str,
        rate: int = 9600,
        at_mode: bool = True,
        first_errors: int = 0,
        failing: Sequence[str] = (),
    ) -> None:
        """`first_errors`: commands answered with an error first; `failing`: those that fail."""
        self.rate, self.at_mode = rate, at_mode
        self.first_errors, self.failing = first_errors, failing
        self.commands: list[str] = []
        self.restarted = False
        self.end = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.end)
        self.begin()

    def let_go(self) -> None:
        os.close(self.end)

    def live(self) -> None:
        part = b""
        while not self.over.is_set():
            if not select.select([self.end], [], [], 0.02)[0]:
                continue
            try:
                part += os.read(self.end, 4096)
            except BlockingIOError:
                continue
            if not self.at_mode:
                part = b""
            while b"\r\n" in part:
                line, part = part.split(b"\r\n", 1)
                command = line.decode("latin-1")
                self.commands.append(command)
                os.write(self.end, self._answer(command).encode())

    def _answer(self, command: str) -> str:
        if self.first_errors:
            self.first_errors -= 1
            return "ERROR:(0)\r\n"
        if any(command.startswith(each) for each in self.failing):
            return "ERROR:(1D)\r\n"
        if command == "AT":
            return "OK\r\n"
        if command == "AT+UART?":
            return f"+UART:{self.rate},0,0\r\nOK\r\n"
        if command.startswith("AT+UART="):
            self.rate = int(command.removeprefix("AT+UART=").split(",")[0])
            return "OK\r\n"
        if command == "AT+RESET":
            self.restarted, self.at_mode = True, False
            return "OK\r\n"
        return "ERROR:(0)\r\n"
