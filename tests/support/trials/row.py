"""One figure beside its target, and what a section of a proof prints."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from traceback import print_exc
from typing import NamedTuple


class Row(NamedTuple):
    """A figure beside its target."""

    what: str
    figure: str
    target: str
    met: bool

    @classmethod
    def counted(cls, what: str, good: int, count: int, target: str = "all") -> Row:
        """How many of `count` are good: all have to be."""
        return cls(what, f"{good} of {count}", target, good == count)

    @classmethod
    def at_most(cls, what: str, value: float, limit: float, unit: str, spec: str = ".1f") -> Row:
        """A value and its largest; `spec` formats it."""
        return cls(what, f"{value:{spec}} {unit}", f"<= {limit:g} {unit}", value <= limit)

    @property
    def verdict(self) -> str:
        """The first word of its line."""
        return "MET" if self.met else "MISSED"


class NoData(Row):
    """A row not measured for want of data or of a program that does not ship."""

    @property
    def verdict(self) -> str:
        return "NO DATA"


class Unjudged(Row):
    """A row of too few trials for its target."""

    @property
    def verdict(self) -> str:
        return "RAN"


class BrokenOff(Row):
    """The last row of a section that raised an exception."""

    @property
    def verdict(self) -> str:
        return "BROKEN OFF"


def with_failure(rows: Iterable[Row]) -> Iterator[Row]:
    """The `rows` of a section; an exception in the middle is a last row, which is missed.

    So what was measured before is kept, and what comes after is measured, too. A section without
    any row is broken off, too.
    """
    count = 0
    try:
        for count, row in enumerate(rows, 1):  # noqa: B007
            yield row
        if not count:
            raise ValueError("the section has no rows")
    except Exception as error:
        print_exc(file=sys.stderr)
        first, _, _ = str(error).partition("\n")
        yield BrokenOff("all rows", f"{type(error).__name__}: {first}", "measured", False)
