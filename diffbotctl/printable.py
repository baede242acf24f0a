"""Text for a terminal: without control characters, and folded between words where it is narrow.

Names, causes and log texts come from files, boards and clients. An escape sequence in one of them
could change the title of a terminal, write to its clipboard, or hide what is printed.
"""

from __future__ import annotations

import re
from io import TextIOWrapper
from textwrap import wrap
from typing import Any, TextIO

REORDERING = "\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"  # and separating: Unicode TR36, 2.4
UNWRITABLE = "\ud800-\udfff\ufffe\uffff"  # in UTF-8 or XML
CONTROL = re.compile(f"[\x00-\x08\x0b-\x1f\x7f-\x9f{REORDERING}{UNWRITABLE}]")  # C0, DEL, C1
STYLE = re.compile("\x1b\\[[0-9;]*m")
REPLACEMENT = "\N{MIDDLE DOT}"
NAME_LENGTH_MAX = 60
# A command, which a user copies as a whole: in backticks, or up to the end of an indented line or
# of one with a colon before it.
COMMAND = re.compile(r"`[^`\n]{1,200}`|(?:^ {4,}|(?<=: ))diffbotctl [a-z].*", re.MULTILINE)
JOINT = "\x00"  # stands for a space within a command while a text is folded
HANG = 2  # columns by which the rest of a folded line is indented


def printable(text: str) -> str:
    """`text` with a middle dot for each control character; tabs and newlines stay."""
    return CONTROL.sub(REPLACEMENT, text)


def shortened(text: str, length: int = NAME_LENGTH_MAX) -> str:
    """`text` with its middle left out if it is longer: a name that a file may have given."""
    if len(text) <= length:
        return text
    return f"{text[: length // 2 - 2]}...{text[-(length - length // 2 - 1) :]}"


def printable_values(value: Any) -> Any:
    """A JSON value whose texts are `printable`, also the keys."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, list):
        return [printable_values(item) for item in value]
    if isinstance(value, dict):
        return {printable(key): printable_values(item) for key, item in value.items()}
    return value


def fold_words(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """Rows of at most `width` columns, folded between words; `first` and `rest` indent them.

    A longer word and a command in backticks stay whole, so that they can be copied.
    """
    rows = wrap(
        _joined(text),
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [row.replace(JOINT, " ") for row in rows]


def _joined(text: str) -> str:
    """`text` with JOINT for each space within a command."""
    return COMMAND.sub(lambda found: found[0].replace(" ", JOINT), text)


def fold_line(line: str, width: int, column: int = 0) -> str:
    """`line` in rows of at most `width` columns, broken at spaces, the first at `column`.

    Continued rows are indented further than the first. A word that is longer than a row, such as
    a path, and a command stay whole, so that they can be copied.
    """
    begin = len(line) - len(line.lstrip(" "))
    hang = " " * min((0 if column else begin) + HANG, width // 2)
    rows, rest, room = [], _joined(line), width - column
    while len(rest) > room:
        end = rest.rfind(" ", begin, room + 1)
        end = end if end > begin else rest.find(" ", max(room, begin + 1))
        if end < 0:
            break
        rows.append(rest[:end].rstrip(" "))
        rest, room, begin = hang + rest[end:].lstrip(" "), width, len(hang)
    return "\n".join([*rows, rest]).replace(JOINT, " ")


class PrintableStream(TextIOWrapper):
    """A text stream that writes control characters as middle dots.

    Escape sequences of our own go through `write_raw`. `columns`: the width of the terminal, at
    which lines are folded between words; None: lines stay whole.
    """

    former: TextIO | None = None
    columns: int | None = None
    column = 0  # where the next text begins, while lines are folded

    def write(self, text: str) -> int:
        """Write `text`, made printable and folded. Returns its length."""
        shown = printable(text)
        super().write(shown if self.columns is None else self._folded(shown, self.columns))
        return len(text)

    def write_raw(self, text: str) -> None:
        """Write `text` as it is."""
        super().write(text)
        if self.columns is not None:
            self._move(STYLE.sub("", text))

    def _folded(self, text: str, columns: int) -> str:
        first, *others = text.split("\n")
        lines = [fold_line(first, columns, self.column), *(fold_line(o, columns) for o in others)]
        folded = "\n".join(lines)
        self._move(folded)
        return folded

    def _move(self, text: str) -> None:
        *begun, last = re.split("[\r\n]", text)
        self.column = len(last) if begun else self.column + len(last)


def fold_lines(stream: TextIO, columns: int | None) -> None:
    """Fold what is written to `stream` at `columns`, between words; None: not."""
    if isinstance(stream, PrintableStream):
        stream.columns = columns


def keep_lines(stream: TextIO) -> None:
    """Write lines whole from now on: another program reads them, or a person copies them."""
    fold_lines(stream, None)


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
    # In the C locale Python escapes surrogates, which are no printable text anyway.
    errors = "replace" if stream.errors in ("strict", "surrogateescape") else stream.errors
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
