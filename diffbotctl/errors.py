"""Problems as the user sees them: the place, the cause and the fix."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from linecache import getlines
from typing import Literal
from unicodedata import east_asian_width

from diffbotctl.printable import fold_words

WIDTH = 80  # columns of the narrowest terminal in common use
CONTEXT_COLUMNS_MIN = 24  # of the user's line, kept before the caret when it is shortened
CAUSE_COLUMNS_MIN = 34  # columns; a cause beside the caret is not wrapped into fewer
WRAP_ALLOWANCE_COLUMNS = 12  # columns that wrapping between words may waste
PROBLEMS_SHOWN_MAX = 30  # more do not help: most of the others follow from the first ones
TEXT_LENGTH_MAX = (
    500  # characters of a cause or a fix; texts of this package have at most half of it
)
ELLIPSIS = "..."
Severity = Literal["error", "warning"]


class Source:
    """A text that problems refer to: a file, or the arguments of a command line."""

    def __init__(self, name: str, text: str, is_own: bool = True) -> None:
        """`is_own`: the user wrote it; False for a file that ships with diffbotctl."""
        self.name = name
        self.is_own = is_own
        self.lines = re.split("\r\n|[\n\r\x85\u2028\u2029]", text)

    def line(self, number: int) -> str:
        """Line `number`, counted from 1; empty after the last one."""
        return self.lines[number - 1] if 0 < number <= len(self.lines) else ""


@dataclass(frozen=True, slots=True)
class Place:
    """A part of one line of a source; line and column are counted from 1."""

    source: Source
    line: int
    column: int
    length: int = 1

    def __str__(self) -> str:
        return f"{self.source.name}:{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake: its code, its place, its cause and how to fix it."""

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
        """Line of the mistake, counted from 1; 0 for the whole file."""
        return 0 if isinstance(self.place, str) else self.place.line

    @property
    def column(self) -> int:
        """Column of the mistake, counted from 1; 0 for the whole file."""
        return 0 if isinstance(self.place, str) else self.place.column

    @property
    def length(self) -> int:
        return 0 if isinstance(self.place, str) else self.place.length

    def render(self, width: int = WIDTH) -> str:
        """The problem as text, in at most `width` columns unless a single word is longer."""
        mark = "  (warning)" if self.severity == "warning" else ""
        head = [f"{escape_control(str(self.place))}  {self.code}{mark}"]
        cause, fix = _safe_text(self.cause), _safe_text(self.fix)
        if isinstance(self.place, str):
            body = _wrapped(cause, "  ", width)
            if fix and len(f"  {cause}; {fix}") <= width:
                return f"{head[0]}\n  {cause}; {fix}"
        else:
            body = _quoted(self.place, cause, width)
        return "\n".join(head + body + _wrapped(fix, "  ", width))


class UserError(Exception):
    """An error that the user can fix, with its problems and the exit code of the command."""

    exit_code = 2

    def __init__(self, problems: Iterable[Problem] | Problem) -> None:
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n\n".join(rendered(self.problems)))


class ConfigurationError(UserError):
    """The files are wrong. Lists every problem of all files; nothing has started."""


class UsageError(UserError):
    """The command line is wrong."""


class RunError(UserError):
    """The command started and then failed."""

    exit_code = 1


def rendered(problems: Sequence[Problem]) -> Iterator[str]:
    """The text of each of the first problems, errors before warnings, and how many others."""
    for problem in sorted(problems, key=lambda each: each.severity)[:PROBLEMS_SHOWN_MAX]:
        yield problem.render()
    more = len(problems) - PROBLEMS_SHOWN_MAX
    if more > 0:
        yield f"and {more} more; `diffbotctl check --json` lists all of them"


def place_in_code(error: BaseException, file: str) -> Place | None:
    """The innermost place in the Python file `file` from which `error` came; None if none is."""
    lines = Source(file, "".join(getlines(file)))
    if isinstance(error, SyntaxError) and error.filename == file and error.lineno:
        return Place(lines, error.lineno, max(1, error.offset or 1))
    trace, found = error.__traceback__, None
    while trace is not None:
        code = trace.tb_frame.f_code
        if code.co_filename == file:
            line, end_line, begin, end = list(code.co_positions())[trace.tb_lasti // 2]
            length = (end or 1) - (begin or 0) if line == end_line else 1
            found = Place(lines, line or trace.tb_lineno, (begin or 0) + 1, length)
        trace = trace.tb_next
    return found


def place_of_function(function: Callable[..., object], file: str) -> Place | None:
    """Where a function is defined in the Python file `file`; None if it is not."""
    code = getattr(function, "__code__", None)
    if code is None or code.co_filename != file:
        return None
    lines = Source(file, "".join(getlines(file)))
    text = getlines(file)[code.co_firstlineno - 1 :][:1]
    indent = len(text[0]) - len(text[0].lstrip()) if text else 0
    return Place(lines, code.co_firstlineno, indent + 1)


def closest_match(word: str, words: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The one of `words` that `word` most likely stands for, or None if none is similar."""
    from difflib import get_close_matches  # needed only after a mistake

    return next(iter(get_close_matches(word[:80], list(words), n=1, cutoff=cutoff)), None)


def join_words(words: Iterable[object], joint: str = "or") -> str:
    """`a, b or c`."""
    texts = [str(word) for word in words]
    if len(texts) < 2:
        return "".join(texts)
    return f"{', '.join(texts[:-1])} {joint} {texts[-1]}"


def escape_control(text: str) -> str:
    """`text` with every control character replaced by a printable one."""
    return "".join(
        character if character.isprintable() else " " if character == "\t" else "\N{MIDDLE DOT}"
        for character in text
    )


def _safe_text(text: str) -> str:
    """A text that may quote a file, without control characters and of limited length."""
    if len(text) > TEXT_LENGTH_MAX:
        text = text[:TEXT_LENGTH_MAX] + ELLIPSIS
    return escape_control(text)


def _quoted(place: Place, cause: str, width: int) -> list[str]:
    """The user's line, and below it the caret followed by the cause."""
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
    return sum(2 if east_asian_width(character) in "WF" else 1 for character in text)


def _wrapped(text: str, indent: str, width: int) -> list[str]:
    return fold_words(text, max(width, len(indent) + 20), indent, indent)
