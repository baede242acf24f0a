"""What to say to an HC-05 in AT mode, and what its answers mean. Sans-IO.

A conversation is a generator: it yields a command, is sent the lines of the answer (none when no
`OK` and no error came in time), and returns what it found out. Commands end with CR and LF, answers
with a line `OK` or `ERROR:(n)`, n hexadecimal.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple

AT_BAUD = 38400  # of every HC-05 whose button was held while its power came on
COMMAND_MAX_TRIES = 3  # the first command after power-on is often answered with an error
RATE_KEY = "+UART:"
# Error numbers that people meet; HC-05 AT command set, appendix.
ERRORS = {
    "0": "it does not know the command",
    "1": "it takes the rate for its own",
    "4": "the command is too long",
    "7": "the name is too long",
    "16": "it is busy with the radio",
}

AtReply = list[str]
AtSession = Generator[str, AtReply, "BaudChange"]


class BaudChange(NamedTuple):
    """The module's rate before and now, baud."""

    before: int
    now: int


class AtModeError(Exception):
    """The module does not answer as an HC-05 in AT mode does; the message says what it did."""


def set_baud(baud: int) -> AtSession:
    """Set the module's rate, look whether it took it, and let it leave AT mode.

    Raises NoAnswerError. Says nothing that changes the module before it has answered twice.
    """
    yield from _greet()
    before = yield from _rate()
    if before != baud:
        yield from _ask(f"AT+UART={baud},0,0")  # one stop bit, no parity
        now = yield from _rate()
        if now != baud:
            raise AtModeError(f"it took the command, but its rate is still {now} baud")
    yield "AT+RESET"  # whatever it answers: it restarts, out of AT mode
    return BaudChange(before, baud)


def _greet() -> Generator[str, AtReply, None]:
    heard: AtReply = []
    for _ in range(COMMAND_MAX_TRIES):
        heard = yield "AT"
        if heard and heard[-1] == "OK":
            return
    raise AtModeError(f"it answers {heard[-1]} to AT" if heard else "nothing answers to AT")


def _rate() -> Generator[str, AtReply, int]:
    for line in (yield from _ask("AT+UART?")):
        if line.startswith(RATE_KEY):
            words = line.removeprefix(RATE_KEY).split(",")
            if words[0].isdigit():
                return int(words[0])
    raise AtModeError("it does not tell its rate")


def _ask(command: str) -> Generator[str, AtReply, AtReply]:
    heard: AtReply = []
    for _ in range(COMMAND_MAX_TRIES):
        heard = yield command
        if heard and heard[-1] == "OK":
            return heard
    if not heard:
        raise AtModeError(f"it has fallen silent over {command}")
    number = heard[-1].removeprefix("ERROR:(").rstrip(")")
    raise AtModeError(f"{command} fails: {ERRORS.get(number, heard[-1])}")


class AtReplyReader:
    """Bytes into lines, up to the one that ends an answer."""

    def __init__(self) -> None:
        self._part = b""
        self.lines: AtReply = []

    def feed(self, data: bytes) -> bool:
        """Take bytes; true when the answer is complete."""
        *whole, self._part = (self._part + data).split(b"\n")
        for each in whole:
            line = each.decode("ascii", "replace").strip()
            if line:
                self.lines.append(line)
        return bool(self.lines) and (self.lines[-1] == "OK" or self.lines[-1].startswith("ERROR"))
