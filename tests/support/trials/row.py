"""One line of a table: what was measured, the figure seen, the target, and whether it is met."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator
from traceback import print_exc
from typing import NamedTuple


class Row(NamedTuple):
    """A figure beside its target."""

    what: str
    figure: str
    target: str
    met: bool

    def line(self) -> str:
        """The row as it is printed."""
        verdict = "ok    " if self.met else "MISSED"
        return f"{verdict}  {self.what:<52} {self.figure:>18}   {self.target}"


class NoData(Row):
    """A row not measured for want of data that does not ship; it counts as not missed."""

    def line(self) -> str:
        """The row as it is printed."""
        return f"  --    {self.what:<52} {self.figure:>18}   {self.target}"


def printed(rows: Iterable[Row]) -> int:
    """Print each row as soon as it is there; how many were missed."""
    missed = 0
    for row in rows:
        print(row.line(), flush=True)
        missed += not row.met
    return missed


def with_failure(name: str, rows: Iterable[Row]) -> Iterator[Row]:
    """The `rows` of a section; an exception in the middle is a last row, which is missed.

    So what was measured before is kept, and what comes after is measured, too.
    """
    try:
        yield from rows
    except Exception as error:
        print_exc(file=sys.stderr)
        first, _, _ = str(error).partition("\n")
        yield Row(
            f"{name}: all rows are measured", f"{type(error).__name__}: {first}", "all", False
        )


def print_rows(rows: Callable[..., Iterable[Row]], description: str, **defaults: float) -> int:
    """Print `rows` of the numbers `defaults`, each of which an option of the command line changes.

    Returns the exit code: 1 when a row is missed.
    """
    parser = argparse.ArgumentParser(description=description)
    for name, default in defaults.items():
        parser.add_argument(f"--{name}", type=type(default), default=default)
    return int(printed(rows(**vars(parser.parse_args()))) > 0)
