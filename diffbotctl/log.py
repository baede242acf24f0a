"""What happens, in words: one line an event, with a level, from a source; never one a message.

A block says `self.log.info("the wall is gone")`. The line gets the logical time of its instant when
the instant is over, so that a block needs no clock and a replay says the same. Where putting a line
into words costs something, ask first: `if self.log.debugs: self.log.debug(f"...")`.
"""

from __future__ import annotations

from collections.abc import Iterator

from diffbotctl.messages import LOG_LEVELS, LogLine
from diffbotctl.time import SECOND

DEBUG, INFO, WARNING, ERROR = range(len(LOG_LEVELS))
OFF = len(LOG_LEVELS)  # a threshold that no line reaches
DEFAULT_LEVEL = "info"
ALL = "*"  # every source
LEVEL = "log_level"  # what a Setting calls the level of a source
NON_BLOCK_SOURCES = ("robot", "operator", "engine")  # sources that are no blocks
LINES_PER_SECOND_MAX = (
    50  # lines of one source in a second: a block that says one a message is cut short
)
LINE_LENGTH_MAX = 400  # characters of a line; more is no line any longer


class Log:
    """The voice of one source. `debugs`: debug lines are wanted at present."""

    def __init__(self, source: str, lines: list[tuple[int, str, str]], threshold: int) -> None:
        self.source = source
        self.lines = lines
        self.set_threshold(threshold)

    def set_threshold(self, threshold: int) -> None:
        """Leave out what is below `threshold`."""
        self.threshold = threshold
        self.debugs = threshold <= DEBUG

    def write(self, level: int, text: str) -> None:
        """Say a line at `level`, a place in LOG_LEVELS."""
        if level >= self.threshold:
            self.lines.append((level, self.source, text))

    def debug(self, text: str) -> None:
        """For whoever looks for a fault in this block."""
        self.write(DEBUG, text)

    def info(self, text: str) -> None:
        """An event of a run that goes well."""
        self.write(INFO, text)

    def warning(self, text: str) -> None:
        """What a person should know of; the run goes on by itself."""
        self.write(WARNING, text)

    def error(self, text: str) -> None:
        """What a person must mend or consent to."""
        self.write(ERROR, text)


QUIET = Log("", [], OFF)  # for a block that stands alone, as in a test


class Logbook:
    """The voices of a run. `lines` holds what was said in the instant that is under way."""

    def __init__(self) -> None:
        self.lines: list[tuple[int, str, str]] = []
        self.logs: dict[str, Log] = {}
        self.line_counts: dict[str, tuple[int, int]] = {}
        for source in NON_BLOCK_SOURCES:
            self.source_log(source)

    def source_log(self, source: str) -> Log:
        """The voice of `source`, at the level `info` unless it was set."""
        if source not in self.logs:
            self.logs[source] = Log(source, self.lines, LOG_LEVELS.index(DEFAULT_LEVEL))
        return self.logs[source]

    def set_level(self, source: str, level: str) -> None:
        """Leave out what `source`, or ALL, says below `level`.

        Raises ValueError for an unknown level.
        """
        logs = self.logs.values() if source == ALL else [self.source_log(source)]
        for log in logs:
            log.set_threshold(LOG_LEVELS.index(level))

    def level(self, source: str) -> str:
        """The level from which on `source` is heard."""
        return LOG_LEVELS[self.source_log(source).threshold]

    def take_lines(self, now: int) -> list[LogLine]:
        """The lines said in this instant, stamped with its time `now`; empties the book."""
        lines = [
            line
            for level, source, text in self.lines
            for line in self._limited(now, level, source, text)
        ]
        self.lines.clear()
        return lines

    def _limited(self, now: int, level: int, source: str, text: str) -> Iterator[LogLine]:
        """The line, none when its source says too many, and how many those were afterwards."""
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
