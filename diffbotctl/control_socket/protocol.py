"""The control protocol's lines: JSON objects, one a line, taken apart with clear refusals.

docs/protocol.md describes it. Nothing here touches a socket: bytes in, requests out.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from math import isfinite
from typing import Any, NoReturn

PROTOCOL = 1
LONGEST_LINE = 64 << 10  # bytes; the longest sensible request has a few hundred
LONGEST_TEXT = 200  # characters of a name


class RefusalError(Exception):
    """A request that is not followed: a code, the cause and the way out, for the one who asked."""

    def __init__(self, code: str, cause: str, fix: str = "") -> None:
        super().__init__(cause)
        self.code = code
        self.cause = cause
        self.fix = fix

    def fields(self) -> dict[str, Any]:
        """What the answer says."""
        said = {"ok": False, "error": self.code, "cause": self.cause}
        return {**said, "fix": self.fix} if self.fix else said


class LineBuffer:
    """Cuts a stream of bytes into lines, and never keeps more than one line's worth."""

    def __init__(self) -> None:
        self.rest = bytearray()
        self.searched = 0

    def add(self, data: bytes) -> None:
        """Take what came from the socket."""
        self.rest += data

    def next(self) -> bytes | None:
        """The next whole line without its end, or None. Raises RefusalError for an endless one."""
        end = self.rest.find(b"\n", self.searched)
        if (end if end >= 0 else len(self.rest)) > LONGEST_LINE:
            cause = f"a line has more than {LONGEST_LINE} bytes"
            raise RefusalError("E-PROTOCOL", cause, "end each request with a newline")
        if end < 0:
            self.searched = len(self.rest)
            return None
        line = bytes(self.rest[:end])
        del self.rest[: end + 1]
        self.searched = 0
        return line


class Request:
    """One line of a client: its fields are taken by name and type, or refused with RefusalError.

    `number` is whatever the client put in `id`; the answer carries it back.
    """

    def __init__(self, fields: dict[str, Any]) -> None:
        self.fields = fields
        number = fields.get("id")
        self.number = number if isinstance(number, int | str) else None

    def text(self, name: str, default: str | None = None) -> str:
        """A text of at most LONGEST_TEXT characters, all of them printable."""
        value = self.fields.get(name, default)
        if not isinstance(value, str) or len(value) > LONGEST_TEXT or not value.isprintable():
            self._wrong(name, f"a printable text of at most {LONGEST_TEXT} characters")
        return value

    def number_of(self, name: str, unit: str, default: float | None = None) -> float:
        """A finite number in `unit`."""
        value = self._finite(name, self.fields.get(name, default))
        if value is None:
            self._wrong(name, f"a finite number ({unit})")
        return value

    def number_or_none(self, name: str, unit: str) -> float | None:
        """A finite number in `unit`; None when it is missing or null."""
        return None if self.fields.get(name) is None else self.number_of(name, unit)

    def flag(self, name: str, default: bool = False) -> bool:
        """True or false."""
        value = self.fields.get(name, default)
        if not isinstance(value, bool):
            self._wrong(name, "true or false")
        return value

    def only(self, *names: str) -> None:
        """Refuse fields that the verb does not know: a misspelt one would be silently ignored."""
        for name in self.fields:
            if name not in (*names, "id", "do"):
                known = f"it takes {', '.join(names)}" if names else "it takes none"
                raise RefusalError("E-REQUEST", f"there is no field '{name[:40]}' here", known)

    def _finite(self, name: str, value: Any) -> float | None:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return None
        try:
            number = float(value)
        except OverflowError:  # a whole number of more than 308 digits
            return None
        return number if isfinite(number) else None

    def _wrong(self, name: str, wanted: str) -> NoReturn:
        what = "is missing" if name not in self.fields else "is something else"
        raise RefusalError("E-REQUEST", f"the field '{name}' must be {wanted}; it {what}")


def parse_request(line: bytes) -> Request:
    """Read one line. Raises RefusalError when it is no JSON object."""
    try:
        fields = json.loads(line.decode("utf-8"), parse_constant=_no_constant)
    except RefusalError:
        raise
    except (ValueError, RecursionError) as error:
        what = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise RefusalError("E-PROTOCOL", f"this line is no JSON: {what[:80]}", EXAMPLE) from None
    if not isinstance(fields, dict):
        raise RefusalError("E-PROTOCOL", "this line is no JSON object", EXAMPLE)
    return Request(fields)


EXAMPLE = 'send one JSON object a line, such as {"do": "stop"}'


def _no_constant(word: str) -> NoReturn:
    raise RefusalError(
        "E-REQUEST", f"{word} is no number that a robot can follow", "send a finite one"
    )


def check_hello(first: Request) -> str:
    """The client's name from its hello. Raises RefusalError for another version."""
    version = first.fields.get("hello")
    if type(version) is not int:
        raise RefusalError(
            "E-PROTOCOL", "the first line must be a hello", 'send {"hello": 1} first'
        )
    if version != PROTOCOL:
        cause = f"protocol {version % 10**9} is not spoken here; this is {PROTOCOL}"
        raise RefusalError(
            "E-PROTOCOL", cause, "install the same version of diffbotctl on both sides"
        )
    return first.text("name", "client")


def encode_line(fields: dict[str, Any]) -> bytes:
    """One line to send."""
    return json.dumps(fields, allow_nan=False).encode() + b"\n"


def encode_lines(data: LineBuffer) -> Iterator[bytes]:
    """All whole lines there are."""
    while (found := data.next()) is not None:
        yield found
