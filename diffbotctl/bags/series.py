"""Recorded fields as curves over time."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.bags.columns import Column, chosen, rows, wires
from diffbotctl.errors import Problem, UsageError, listed
from diffbotctl.graph import NEVER, SECOND


class Series(NamedTuple):
    """One field over time: times in s since the start of the run; gaps in the values are nan."""

    name: str
    unit: str
    times: list[float]
    values: list[float]

    def bounds(self) -> tuple[float, float]:
        """Least and greatest value; (0, 0) when it has none."""
        least, most = inf, -inf
        for value in self.values:
            if isfinite(value):
                least, most = min(least, value), max(most, value)
        return (least, most) if least <= most else (0.0, 0.0)


def series(path: Path, names: Sequence[str], begin: int = 0, until: int = NEVER) -> list[Series]:
    """The fields called `names` of the recording at `path`, from `begin` to before `until` (ns).

    A topic alone stands for all its fields that are numbers. Raises UsageError for a field that is
    not there or holds no numbers, RunError for a file that is no recording.
    """
    known = wires(path)
    columns = chosen(names, known)
    found = [Series(column.name, column.unit, [], []) for column in columns]
    words: set[int] = set()
    for time, row in rows(path, columns):
        if not begin <= time < until:
            continue
        for place, value in enumerate(row):
            if value is None:
                continue
            if isinstance(value, (str, tuple)):
                words.add(place)
                continue
            found[place].times.append(time / SECOND)
            found[place].values.append(_number(value))
    _refuse([column for place, column in enumerate(columns) if place in words], names)
    drawn = [each for each in found if each.times]
    if not drawn:
        cause = f"none of {listed(names)} has a number in that time"
        raise UsageError(Problem("E-FIELD", str(path), cause, "see diffbotctl bag info"))
    return drawn


def _refuse(columns: list[Column], names: Sequence[str]) -> None:
    """A field that was asked for by its own name must be a number; one of a topic is left out."""
    for column in columns:
        if column.name in names:
            cause = f"{column.name} holds words or lists; a curve needs numbers"
            raise UsageError(Problem("E-FIELD", column.name, cause, "see them with bag export"))


def _number(value: Any) -> float:
    number = float(value)
    return number if isfinite(number) else nan
