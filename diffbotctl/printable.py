"""Text for a terminal without control characters.

Names, causes and log texts come from files, boards and clients. An escape sequence in one of them
could change the title of a terminal, write to its clipboard, or hide what is printed.
"""

from __future__ import annotations

import re
from io import TextIOWrapper
from typing import Any, TextIO

# C0 but tab and newline, DEL, C1, the line separators, and what reorders text (Unicode TR36, 2.4).
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
REPLACEMENT = "\N{MIDDLE DOT}"


def printable(text: str) -> str:
    """`text` with a middle dot for each control character; tabs and newlines stay."""
    return CONTROL.sub(REPLACEMENT, text)


def printable_values(value: Any) -> Any:
    """A JSON value whose texts are `printable`, also the keys."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, list):
        return [printable_values(item) for item in value]
    if isinstance(value, dict):
        return {printable(key): printable_values(item) for key, item in value.items()}
    return value


class PrintableStream(TextIOWrapper):
    """A text stream that writes control characters as middle dots.

    Escape sequences of our own go through `write_raw`.
    """

    former: TextIO | None = None

    def write(self, text: str) -> int:
        """Write `text`, made printable. Returns its length."""
        super().write(printable(text))
        return len(text)

    def write_raw(self, text: str) -> None:
        """Write `text` as it is."""
        super().write(text)


class RawStream:
    """A PrintableStream that writes escape sequences as they are."""

    def __init__(self, stream: PrintableStream) -> None:
        self.stream = stream
        self.write = stream.write_raw

    def __getattr__(self, name: str) -> Any:
        """Everything but `write` is that of the stream."""
        return getattr(self.stream, name)


def printable_stream(stream: TextIO) -> TextIO:
    """A PrintableStream in place of `stream`, which must not be used any more."""
    if not isinstance(stream, TextIOWrapper) or isinstance(stream, PrintableStream):
        return stream
    stream.flush()
    errors = "replace" if stream.errors == "strict" else stream.errors
    new = PrintableStream(
        stream.buffer,
        stream.encoding,
        errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
    new.former = stream  # when it is collected, it closes the file of both
    return new


def write_raw(stream: TextIO, text: str) -> None:
    """Write an escape sequence of our own; texts from elsewhere in it must be `printable`."""
    if isinstance(stream, PrintableStream):
        stream.write_raw(text)
    else:
        stream.write(text)
