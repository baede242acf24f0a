"""Lines of the control protocol: one JSON object a line, and the error that refuses a request.

docs/protocol.md describes the protocol. Nothing here touches a socket.
"""

from __future__ import annotations

import json
from typing import Any, NoReturn

Fields = dict[str, Any]

PROTOCOL = 2
QUOTED_BYTES = 60  # of a line that is refused
LINE_MAX_BYTES = 64 << 10  # the longest sensible request has a few hundred
DRIVE_LEASE_S = 0.3  # age at which a command to drive is refused, if it states when it was made
# The actions that together put everything back to the start, as far as a run has them.
RESET_ACTIONS = ("robot.home", "odometry.set_pose", "canvas.start_over")
EXAMPLE = 'send one JSON object a line, such as {"method": "stop"}'


class RefusalError(Exception):
    """A request that is refused: an error code, the cause and the fix."""

    def __init__(self, code: str, cause: str, fix: str = "") -> None:
        super().__init__(cause)
        self.code = code
        self.cause = cause
        self.fix = fix

    @property
    def text(self) -> str:
        return f"{self.cause}; {self.fix}" if self.fix else self.cause

    def fields(self) -> Fields:
        reply = {"ok": False, "error": self.code, "cause": self.cause}
        return {**reply, "fix": self.fix} if self.fix else reply


class LineBuffer:
    """Splits a stream of bytes into lines; it never holds more than one line and one read."""

    def __init__(self) -> None:
        self.rest = bytearray()
        self.searched = 0

    def add(self, data: bytes) -> None:
        self.rest += data

    def take(self, data: bytes) -> list[bytes]:
        """The complete lines after `data` has come. Raises RefusalError if one is too long."""
        is_line = data.find(b"\n") == len(data) - 1 and 0 < len(data) <= LINE_MAX_BYTES
        if is_line and not self.rest:
            return [data[:-1]]  # most times one line comes, and nothing else
        self.add(data)
        lines = []
        while (line := self.next()) is not None:
            lines.append(line)
        return lines

    def next(self) -> bytes | None:
        """The next complete line without its newline, or None. Raises RefusalError if too long."""
        end = self.rest.find(b"\n", self.searched)
        if (end if end >= 0 else len(self.rest)) > LINE_MAX_BYTES:
            cause = f"a line has more than {LINE_MAX_BYTES} bytes"
            raise RefusalError("E-PROTOCOL", cause, "end each request with a newline")
        if end < 0:
            self.searched = len(self.rest)
            return None
        line = bytes(self.rest[:end])
        del self.rest[: end + 1]
        self.searched = 0
        return line


def parse_line(line: bytes) -> Fields:
    """The JSON object in one line. Raises RefusalError when it is none."""
    try:
        text = line.decode("utf-8")
        if text.startswith("{"):
            fields, end = DECODER.raw_decode(text)
            if end == len(text):  # most lines have no space around the object
                return fields  # type: ignore[no-any-return]
        fields = DECODER.decode(text)
    except RecursionError:
        raise RefusalError(
            "E-PROTOCOL", "this line is not JSON: nested too deeply", EXAMPLE
        ) from None
    except ValueError as error:
        cause = f"this line is not JSON: {_quoted(line)}: {str(error)[:80]}"
        raise RefusalError("E-PROTOCOL", cause, EXAMPLE) from None
    if not isinstance(fields, dict):
        raise RefusalError(
            "E-PROTOCOL", f"this line is not a JSON object: {_quoted(line)}", EXAMPLE
        )
    return fields


def _quoted(line: bytes) -> str:
    return ascii(line[:QUOTED_BYTES].decode(errors="replace").rstrip())


def _refuse_constant(name: str) -> NoReturn:
    cause = f"{name} is not a finite number"
    raise RefusalError("E-REQUEST", cause, "send a finite one")


DECODER = json.JSONDecoder(parse_constant=_refuse_constant)  # made once: 5 us


def encode_line(fields: Fields) -> bytes:
    return json.dumps(fields, allow_nan=False).encode() + b"\n"
