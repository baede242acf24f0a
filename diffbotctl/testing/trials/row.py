"""One line of a table: what was measured, the figure seen, the target, and whether it is met."""

from __future__ import annotations

from collections.abc import Iterable
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
