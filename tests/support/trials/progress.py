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
from typing import TextIO

from tests.support.trials.row import Row, with_failure

MINUTE_S = 60.0
HOUR_MIN = 60


class SectionTimes:
    """The time of each section, s, kept in a JSON file from proof to proof."""

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

    def note(self, section: str, seconds: float) -> None:
        """Keep how long a section took. A file that cannot be written costs only the estimate."""
        self.known[section] = round(seconds, 1)
        with suppress(OSError):
            self.file.parent.mkdir(parents=True, exist_ok=True)
            self.file.write_text(json.dumps(self.known, indent=1), encoding="utf-8")


def with_progress(
    sections: Sequence[tuple[str, Iterator[Row]]],
    times: SectionTimes,
    output: TextIO = sys.stderr,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[tuple[str, Row]]:
    """The rows of all sections, each with the name of its section; `clock` gives s.

    A line in `output` begins each section, and follows a row of it when a minute has passed. A
    section that fails in the middle has a last row that is missed, and the next one follows.
    """
    began = clock()
    for number, (name, rows) in enumerate(sections):
        started = last = clock()
        expected = times.known.get(name)
        later = [times.known.get(each) for each, _ in sections[number + 1 :]]
        title = f"{number + 1} of {len(sections)}  {name}"
        words = time_text(started - began, [expected, *later])
        print(f"{title}: {words}", file=output, flush=True)
        for count, row in enumerate(with_failure(rows), 1):
            yield name, row
            now = clock()
            if now - last >= MINUTE_S:
                last = now
                left = None if expected is None else max(expected - (now - started), 0.0)
                words = time_text(now - began, [left, *later])
                print(f"{title}, row {count}: {words}", file=output, flush=True)
        times.note(name, clock() - started)


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
