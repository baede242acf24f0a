"""AT commands of an HC-05, and what its replies mean. Sans-IO.

A session is a generator: it yields a command, is sent the lines of the reply (none when no `OK` and
no error arrived in time), and returns its result. Commands end with CR and LF, replies with a line
`OK` or `ERROR:(n)`, n hexadecimal.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple

COMMAND_MAX_TRIES = 3  # the first command after power-on is often answered with an error
BAUD_PREFIX = "+UART:"
# The usual error numbers; HC-05 AT command set, appendix.
ERRORS = {
    "0": "unknown command",
    "1": "the rate is already set",
    "4": "the command is too long",
    "7": "the name is too long",
    "16": "the radio is busy",
}

AtReply = list[str]


class BaudChange(NamedTuple):
    """The module's rate before and now, baud."""

    before: int
    now: int


AtSession = Generator[str, AtReply, BaudChange]


class AtModeError(Exception):
    """The module does not answer as an HC-05 in AT mode; the message describes its reply."""


def set_baud(baud: int) -> AtSession:
    """Set the module's rate, check it, and leave AT mode.

    Raises AtModeError. Sends no command that changes the module before it has answered twice.
    """
    reply = yield from _try("AT")
    if not _is_ok(reply):
        raise AtModeError(f"it answers {reply[-1]} to AT" if reply else "no answer to AT")
    before = yield from _read_baud()
    if before != baud:
        yield from _command(f"AT+UART={baud},0,0")  # one stop bit, no parity
        now = yield from _read_baud()
        if now != baud:
            raise AtModeError(f"it accepted the command, but its rate is still {now} baud")
    yield "AT+RESET"  # it restarts outside AT mode, with any reply
    return BaudChange(before, baud)


def _read_baud() -> Generator[str, AtReply, int]:
    for line in (yield from _command("AT+UART?")):
        baud = line.removeprefix(BAUD_PREFIX).split(",")[0]
        if line.startswith(BAUD_PREFIX) and baud.isdigit():
            return int(baud)
    raise AtModeError("it does not report its rate")


def _command(command: str) -> Generator[str, AtReply, AtReply]:
    reply = yield from _try(command)
    if _is_ok(reply):
        return reply
    if not reply:
        raise AtModeError(f"no answer to {command}")
    number = reply[-1].removeprefix("ERROR:(").rstrip(")")
    raise AtModeError(f"{command} fails: {ERRORS.get(number, reply[-1])}")


def _try(command: str) -> Generator[str, AtReply, AtReply]:
    """Send a command until it succeeds, up to COMMAND_MAX_TRIES times; the last reply."""
    reply: AtReply = []
    for _ in range(COMMAND_MAX_TRIES):
        reply = yield command
        if _is_ok(reply):
            break
    return reply


def _is_ok(reply: AtReply) -> bool:
    return reply[-1:] == ["OK"]


class AtReplyReader:
    """Splits bytes into lines, up to the one that ends a reply."""

    def __init__(self) -> None:
        self._part = b""
        self.lines: AtReply = []

    def feed(self, data: bytes) -> bool:
        """Take bytes; True when the reply is complete."""
        *lines, self._part = (self._part + data).split(b"\n")
        texts = (line.decode("ascii", "replace").strip() for line in lines)
        self.lines += filter(None, texts)
        return _is_ok(self.lines) or (bool(self.lines) and self.lines[-1].startswith("ERROR"))
