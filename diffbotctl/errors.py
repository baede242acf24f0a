"""What went wrong, said to a person: where it stands, what is wrong, what to do about it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from textwrap import wrap
from typing import Literal

WIDTH = 80  # columns of the narrowest terminal in common use
CONTEXT_COLUMNS_MIN = 24  # of the user's line, kept before the caret when it is shortened
CAUSE_COLUMNS_MIN = 34  # columns below which a cause beside the caret becomes a thin tower of words
WRAP_ALLOWANCE_COLUMNS = 12  # columns that breaking between words may cost
TEXT_LENGTH_MAX = 500  # characters of a cause or a fix; ours have at most half of it
ELLIPSIS = "..."
Severity = Literal["error", "warning"]


class Source:
    """A text that problems can point into: a file, or the words of a command line."""

    def __init__(self, name: str, text: str, is_own: bool = True) -> None:
        """`is_own`: the user wrote it, as opposed to a file that ships with diffbotctl."""
        self.name = name
        self.is_own = is_own
        self.lines = re.split("\r\n|[\n\r\x85\u2028\u2029]", text)

    def line(self, number: int) -> str:
        """Line `number`, counted from 1; empty beyond the end."""
        return self.lines[number - 1] if 0 < number <= len(self.lines) else ""


@dataclass(frozen=True, slots=True)
class Place:
    """A stretch of one line of a source; line and column count from 1."""

    source: Source
    line: int
    column: int
    length: int = 1

    def __str__(self) -> str:
        return f"{self.source.name}:{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake: a code to look up, its place, its cause in words, and the way out."""

    code: str
    place: Place | str
    cause: str
    fix: str = ""
    severity: Severity = "error"

    @property
    def file(self) -> str:
        return self.place if isinstance(self.place, str) else self.place.source.name

    @property
    def line(self) -> int:
        """Line of the mistake from 1; 0 when the whole file is meant."""
        return 0 if isinstance(self.place, str) else self.place.line

    @property
    def column(self) -> int:
        """Column of the mistake from 1; 0 when the whole file is meant."""
        return 0 if isinstance(self.place, str) else self.place.column

    @property
    def length(self) -> int:
        return 0 if isinstance(self.place, str) else self.place.length

    def render(self, width: int = WIDTH) -> str:
        """The problem as a person reads it, in at most `width` columns where its words allow."""
        mark = "  (warning)" if self.severity == "warning" else ""
        head = [f"{escape_control(str(self.place))}  {self.code}{mark}"]
        cause, fix = _safe_text(self.cause), _safe_text(self.fix)
        if isinstance(self.place, str):
            body = _wrapped(cause, "  ", width)
        else:
            body = _quoted(self.place, cause, width)
        return "\n".join(head + body + _wrapped(fix, "  ", width))


class UserError(Exception):
    """Something that a person can mend; carries the problems and the exit code to leave with."""

    exit_code = 2

    def __init__(self, problems: Iterable[Problem] | Problem) -> None:
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n\n".join(problem.render() for problem in self.problems))


class ConfigurationError(UserError):
    """The files are wrong: every problem of all of them at once. Nothing has started."""


class UsageError(UserError):
    """The command line is wrong."""


class RunError(UserError):
    """It ran, and failed."""

    exit_code = 1


def closest_match(word: str, words: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The one of `words` that was probably meant by `word`, or None when none is near."""
    from difflib import get_close_matches  # needed only after a mistake

    return next(iter(get_close_matches(word[:80], list(words), n=1, cutoff=cutoff)), None)


def join_words(words: Iterable[object], joint: str = "or") -> str:
    """`a, b or c`."""
    texts = [str(word) for word in words]
    if len(texts) < 2:
        return "".join(texts)
    return f"{', '.join(texts[:-1])} {joint} {texts[-1]}"


def escape_control(text: str) -> str:
    """`text` with every character that would upset a terminal replaced by one that does not."""
    return "".join(
        character if character.isprintable() else " " if character == "\t" else "\N{MIDDLE DOT}"
        for character in text
    )


def _safe_text(text: str) -> str:
    """Words that may quote a file: nothing in them steers the terminal, nor fills it."""
    if len(text) > TEXT_LENGTH_MAX:
        text = text[:TEXT_LENGTH_MAX] + ELLIPSIS
    return escape_control(text)


def _quoted(place: Place, cause: str, width: int) -> list[str]:
    """The user's own line, and below it the caret with the cause behind it."""
    number = f"  {place.line} "
    line, before, marked = _shortened(place, len(cause), width - len(number) - 2)
    margin = " " * len(number) + "| "
    first = f"{number}| {line}".rstrip()
    caret = margin + " " * _display_width(before) + "^" * marked
    beside = width - len(caret) - 1
    if len(cause) <= beside or (
        beside >= CAUSE_COLUMNS_MIN and len(cause) <= 2 * beside - WRAP_ALLOWANCE_COLUMNS
    ):
        lines = _wrapped(cause, " " * (len(caret) - len(margin) + 1), width - len(margin))
        return [first, f"{caret} {lines[0].lstrip()}", *(margin + text for text in lines[1:])]
    return [first, caret, *(margin + text for text in _wrapped(cause, "", width - len(margin)))]


def _shortened(place: Place, cause_length: int, available: int) -> tuple[str, str, int]:
    """The line of `place` in `available` columns: the line, its part before the caret, and how many
    characters the caret marks."""
    line = escape_control(place.source.line(place.line))
    before = line[: place.column - 1]
    marked = max(1, min(place.length, len(line) - place.column + 1))
    after_caret = marked + 1 + cause_length
    if _display_width(line) <= available and _display_width(before) + after_caret <= available:
        return line, before, marked
    keep = max(CONTEXT_COLUMNS_MIN, available - after_caret)
    if len(before) > keep:
        line = ELLIPSIS + line[len(before) - keep + len(ELLIPSIS) :]
        before = ELLIPSIS + before[len(before) - keep + len(ELLIPSIS) :]
    if _display_width(line) > available:
        line = line[: max(available - len(ELLIPSIS), len(before) + 1)] + ELLIPSIS
    return line, before, min(marked, max(1, available - len(before)))


def _display_width(text: str) -> int:
    from unicodedata import east_asian_width  # a table of 300 kB: only where errors are shown

    return sum(2 if east_asian_width(character) in "WF" else 1 for character in text)


def _wrapped(text: str, indent: str, width: int) -> list[str]:
    return wrap(
        text,
        max(width, len(indent) + 20),
        initial_indent=indent,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
