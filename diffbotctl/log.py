"""The log of a run: one line for each event, with a level and a source.

A block calls `self.log.info("the wall is gone")`. The line gets the logical time of its instant, so
a block needs no clock and a replay logs the same lines. Log events, not messages. If the text is
expensive to build, check the level first: `if self.log.debugs: self.log.debug(f"...")`. What a
block prints is logged too.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import TextIOBase

from diffbotctl.messages import LOG_LEVELS, LogLine
from diffbotctl.time import SECOND

DEBUG, INFO, WARNING, ERROR = range(len(LOG_LEVELS))
OFF = len(LOG_LEVELS)  # a threshold above every level
DEFAULT_LEVEL = "info"
ALL = "*"  # every source
LEVEL = "log_level"  # the name of a source's level in a Setting
ENGINE = "engine"
NON_BLOCK_SOURCES = ("robot", "operator", ENGINE)  # sources other than blocks
LINES_PER_SECOND_MAX = 50  # of one source; limits a block that logs every message
LINE_LENGTH_MAX = 400  # characters; longer lines are cut


class Log:
    """The log of one source. `debugs`: lines of level debug are kept at present."""

    def __init__(self, source: str, lines: list[tuple[int, str, str]], threshold: int) -> None:
        self.source = source
        self.lines = lines
        self.set_threshold(threshold)

    def set_threshold(self, threshold: int) -> None:
        """Discard lines below `threshold`."""
        self.threshold = threshold
        self.debugs = threshold <= DEBUG

    def write(self, level: int, text: str) -> None:
        """Log a line at `level`, an index of LOG_LEVELS."""
        if level >= self.threshold:
            self.lines.append((level, self.source, text))

    def debug(self, text: str) -> None:
        """Log a detail for debugging this block."""
        self.write(DEBUG, text)

    def info(self, text: str) -> None:
        """Log an event of normal operation."""
        self.write(INFO, text)

    def warning(self, text: str) -> None:
        """Log an event that the operator should know of; the run continues by itself."""
        self.write(WARNING, text)

    def error(self, text: str) -> None:
        """Log an event that needs action by the operator."""
        self.write(ERROR, text)


class LogFile(TextIOBase):
    """A text file whose lines go to a log: what a block prints."""

    def __init__(self, log: Log) -> None:
        self.log, self.rest = log, ""

    def write(self, text: str) -> int:
        """Log each line that is complete, or too long to wait for its end."""
        *lines, self.rest = (self.rest + text).split("\n")
        for line in lines:
            self.log.info(line)
        if len(self.rest) > LINE_LENGTH_MAX:
            self.log.info(self.rest)
            self.rest = ""
        return len(text)


QUIET = Log("", [], OFF)  # for a block outside a graph, as in a test


class Logbook:
    """The logs of a run by source. `lines` holds the lines of the current instant."""

    def __init__(self) -> None:
        self.lines: list[tuple[int, str, str]] = []
        self.logs: dict[str, Log] = {}
        self.line_counts: dict[str, tuple[int, int]] = {}
        for source in NON_BLOCK_SOURCES:
            self.source_log(source)

    def source_log(self, source: str) -> Log:
        """The log of `source`; its level is `info` unless it was set."""
        if source not in self.logs:
            self.logs[source] = Log(source, self.lines, LOG_LEVELS.index(DEFAULT_LEVEL))
        return self.logs[source]

    def set_level(self, source: str, level: str) -> None:
        """Discard lines of `source`, or of ALL, below `level`.

        Raises ValueError for an unknown level.
        """
        logs = self.logs.values() if source == ALL else [self.source_log(source)]
        for log in logs:
            log.set_threshold(LOG_LEVELS.index(level))

    def level(self, source: str) -> str:
        """The lowest level at which lines of `source` are kept."""
        return LOG_LEVELS[self.source_log(source).threshold]

    def take_lines(self, now: int) -> list[LogLine]:
        """Remove and return the lines of this instant, with its time `now`."""
        lines = [
            line
            for level, source, text in self.lines
            for line in self._limited(now, level, source, text)
        ]
        self.lines.clear()
        return lines

    def _limited(self, now: int, level: int, source: str, text: str) -> Iterator[LogLine]:
        """The line, unless its source exceeds the limit; and later, how many were left out."""
        start, count = self.line_counts.get(source, (now, 0))
        if now - start >= SECOND:
            if count > LINES_PER_SECOND_MAX:
                excess = count - LINES_PER_SECOND_MAX
                text_of_excess = f"{excess} lines of {source} were left out: too many in a second"
                yield LogLine(now, "warning", source, text_of_excess)
            start, count = now, 0
        self.line_counts[source] = start, count + 1
        if count < LINES_PER_SECOND_MAX:
            yield LogLine(now, LOG_LEVELS[level], source, text[:LINE_LENGTH_MAX])


class NamedLogbook(Logbook):
    """The logs of one robot of several: a source of it is `name.source` in `book`."""

    def __init__(self, book: Logbook, name: str) -> None:
        self.book, self.prefix = book, f"{name}."
        super().__init__()
        self.lines = book.lines

    def source_log(self, source: str) -> Log:
        """The log of `source` of this robot; the engine is common to all of them."""
        if source not in self.logs:
            prefix = "" if source == ENGINE else self.prefix
            self.logs[source] = self.book.source_log(f"{prefix}{source}")
        return self.logs[source]
