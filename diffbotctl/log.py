"""What happens, in words: one line an event, with a level, from a source; never one a message.

A block says `self.log.info("the wall is gone")`. The line gets the logical time of its instant when
the instant is over, so that a block needs no clock and a replay says the same. Where putting a line
into words costs something, ask first: `if self.log.debugs: self.log.debug(f"...")`.
"""

from __future__ import annotations

from diffbotctl.messages import LOG_LEVELS, LogLine
from diffbotctl.time import SECOND

DEBUG, INFO, WARNING, ERROR = range(len(LOG_LEVELS))
NOTHING = len(LOG_LEVELS)  # a threshold that no line reaches
DEFAULT = "info"
ALL = "*"  # every source
LEVEL = "log_level"  # what a Setting calls the level of a source
OUTSIDE = ("robot", "operator", "engine")  # sources that are no blocks
MOST = 50  # lines of one source in a second: a block that says one a message is cut short
LONGEST = 400  # characters of a line; more is no line any longer


class Log:
    """The voice of one source. `debugs`: debug lines are wanted at present."""

    def __init__(self, source: str, lines: list[tuple[int, str, str]], threshold: int) -> None:
        self.source = source
        self.lines = lines
        self.set(threshold)

    def set(self, threshold: int) -> None:
        """Leave out what is below `threshold`."""
        self.threshold = threshold
        self.debugs = threshold <= DEBUG

    def say(self, level: int, text: str) -> None:
        """Say a line at `level`, a place in LOG_LEVELS."""
        if level >= self.threshold:
            self.lines.append((level, self.source, text))

    def debug(self, text: str) -> None:
        """For whoever looks for a fault in this block."""
        self.say(DEBUG, text)

    def info(self, text: str) -> None:
        """An event of a run that goes well."""
        self.say(INFO, text)

    def warning(self, text: str) -> None:
        """What a person should know of; the run goes on by itself."""
        self.say(WARNING, text)

    def error(self, text: str) -> None:
        """What a person must mend or consent to."""
        self.say(ERROR, text)


QUIET = Log("", [], NOTHING)  # for a block that stands alone, as in a test


class Logbook:
    """The voices of a run. `lines` holds what was said in the instant that is under way."""

    def __init__(self) -> None:
        self.lines: list[tuple[int, str, str]] = []
        self.logs: dict[str, Log] = {}
        self.said: dict[str, tuple[int, int]] = {}
        for source in OUTSIDE:
            self.of(source)

    def of(self, source: str) -> Log:
        """The voice of `source`, at the level `info` unless it was set."""
        if source not in self.logs:
            self.logs[source] = Log(source, self.lines, LOG_LEVELS.index(DEFAULT))
        return self.logs[source]

    def set_level(self, source: str, level: str) -> None:
        """Leave out what `source`, or ALL, says below `level`.

        Raises ValueError for an unknown level.
        """
        logs = self.logs.values() if source == ALL else [self.of(source)]
        for log in logs:
            log.set(LOG_LEVELS.index(level))

    def level(self, source: str) -> str:
        """The level from which on `source` is heard."""
        return LOG_LEVELS[self.of(source).threshold]

    def taken(self, now: int) -> list[LogLine]:
        """The lines said in this instant, stamped with its time `now`; empties the book."""
        found: list[LogLine] = []
        for level, source, text in self.lines:
            found += self._counted(now, level, source, text)
        self.lines.clear()
        return found

    def _counted(self, now: int, level: int, source: str, text: str) -> list[LogLine]:
        """The line, none when its source says too many, and how many those were afterwards."""
        since, count = self.said.get(source, (now, 0))
        found = []
        if now - since >= SECOND:
            if count > MOST:
                left_out = f"{count - MOST} lines of {source} were left out: too many in a second"
                found.append(LogLine(now, "warning", source, left_out))
            since, count = now, 0
        self.said[source] = since, count + 1
        if count < MOST:
            found.append(LogLine(now, LOG_LEVELS[level], source, text[:LONGEST]))
        return found
