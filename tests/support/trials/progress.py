"""Progress of a long proof: its sections one after the other, the time so far and the time left.

The time left follows from how long each section took on this machine the last time.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, TextIO

from tests.support.trials.row import Row, with_failure

MINUTE_S = 60.0
HOUR_MIN = 60


class ProofSection(NamedTuple):
    """Rows that belong together. `size`: the number of trials with which their time grows."""

    name: str
    rows: Iterator[Row]
    size: float = 1.0


class SectionTimes:
    """The time of each section per unit of its size, s, kept in a JSON file from proof to proof."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.known: dict[str, float] = {}
        with suppress(OSError, ValueError, AttributeError):  # none yet, or not written by this
            content = json.loads(file.read_text(encoding="utf-8"))
            self.known = {
                name: float(value)
                for name, value in content.items()
                if isinstance(value, int | float) and value >= 0.0
            }

    def estimate(self, section: ProofSection) -> float | None:
        """The expected time of `section`, s; None if it has not been measured here."""
        known = self.known.get(section.name)
        return None if known is None else known * section.size

    def note(self, section: ProofSection, seconds: float) -> None:
        """Keep how long `section` took. A file that cannot be written costs only the estimate."""
        if section.size <= 0.0:
            return
        self.known[section.name] = seconds / section.size
        with suppress(OSError):
            self.file.parent.mkdir(parents=True, exist_ok=True)
            self.file.write_text(json.dumps(self.known, indent=1), encoding="utf-8")


def with_progress(
    sections: Sequence[ProofSection],
    times: SectionTimes,
    output: TextIO = sys.stderr,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Row]:
    """The rows of all sections; `clock` gives s.

    A line in `output` begins each section, and follows a row of it when a minute has passed. A
    section that fails in the middle is a missed row, and the next one follows.
    """
    began = clock()
    for number, section in enumerate(sections):
        started = reported = clock()
        expected = times.estimate(section)
        later = [times.estimate(each) for each in sections[number + 1 :]]
        title = f"{number + 1} of {len(sections)}  {section.name}"
        words = time_text(started - began, [expected, *later])
        print(f"{title}: {words}", file=output, flush=True)
        for count, row in enumerate(with_failure(section.name, section.rows), 1):
            yield row
            now = clock()
            if now - reported >= MINUTE_S:
                reported = now
                left = None if expected is None else max(expected - (now - started), 0.0)
                words = time_text(now - began, [left, *later])
                print(f"{title}, row {count}: {words}", file=output, flush=True)
        times.note(section, clock() - started)


def time_text(elapsed: float, left: Sequence[float | None]) -> str:
    """The time so far and the time left, from the expected times (s) of what is not done."""
    known = sum(each for each in left if each is not None)
    text = f"{_duration(elapsed)} so far"
    if None not in left:
        return f"{text}, about {_duration(known)} left"
    return f"{text}, more than {_duration(known)} left" if known >= MINUTE_S else text


def _duration(seconds: float) -> str:
    minutes = round(seconds / MINUTE_S)
    hours, rest = divmod(minutes, HOUR_MIN)
    return f"{hours} h {rest} min" if hours else f"{minutes} min"
