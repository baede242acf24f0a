"""One line of a table: what was measured, the figure seen, the target, and whether it is met."""

from __future__ import annotations

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
