"""Fields of recorded messages by name, such as `odometry.odometry.x`: as table rows or curves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple, get_args

from diffbotctl.errors import Problem, UsageError, closest_match, join_words
from diffbotctl.message_types import is_record, is_tuple, parts, type_name
from diffbotctl.messages import fields
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.time import NEVER, SECOND


class Column(NamedTuple):
    """One field of the messages of one topic: `steps` lead from a message to the value."""

    name: str
    wire: str
    steps: tuple[str, ...]
    unit: str

    def of(self, message: Any) -> Any:
        """The field's value in `message`; None where it has none at these steps."""
        value = message
        for step in self.steps:
            if value is None:
                return None
            if step.isdecimal():
                value = value[int(step)] if int(step) < len(value) else None
            else:
                value = getattr(value, step)
        return value


def all_wires(path: Path) -> tuple[dict[str, type], dict[str, type]]:
    """Every topic of the run in the recording at `path`, and those with a message: its class.

    Raises RunError for a file that is not a recording.
    """
    reader = RecordingReader(path)
    topics = {channel.topic for channel, _ in reader.records()}
    return reader.kinds, {wire: kind for wire, kind in reader.kinds.items() if wire in topics}


def column_wires(path: Path) -> dict[str, type]:
    """The topics with a message."""
    return all_wires(path)[1]


def choose_columns(names: Sequence[str], wires: dict[str, type]) -> list[Column]:
    """The columns called `names`; a topic alone means all its fields.

    Raises UsageError with the closest name for one that does not exist.
    """
    columns: list[Column] = []
    for name in names:
        columns += _topic_columns(name, wires[name]) if name in wires else [_column(name, wires)]
    return columns


def all_columns(wires: dict[str, type]) -> list[Column]:
    return [column for wire, kind in wires.items() for column in _topic_columns(wire, kind)]


def table_rows(path: Path, columns: Sequence[Column]) -> Iterator[tuple[int, list[Any]]]:
    """(logical time in ns, one value a column or None) for each instant with one of `columns`."""
    by_wire: dict[str, list[tuple[int, Column]]] = {}
    for place, column in enumerate(columns):
        by_wire.setdefault(column.wire, []).append((place, column))
    messages = (item for item in RecordingReader(path).messages() if item.wire in by_wire)
    for (_, time), items in groupby(messages, key=lambda item: (item.instant, item.time)):
        row: list[Any] = [None] * len(columns)
        for item in items:
            for place, column in by_wire[item.wire]:
                row[place] = column.of(item.message)
        yield time, row


def _topic_columns(wire: str, kind: type) -> list[Column]:
    """A column for each single value; a list of any length makes none, its items can be named."""
    return [
        Column(".".join((wire, *steps)), wire, steps, unit)
        for name, (hint, declaration) in fields(kind).items()
        if name != "time"
        for steps, unit in _single_values((name,), hint, declaration.unit)
    ]


def _single_values(
    steps: tuple[str, ...], hint: Any, unit: str
) -> Iterator[tuple[tuple[str, ...], str]]:
    """The steps to each single value in a field of type `hint`, and its unit."""
    kind = _without_none(hint)
    if is_tuple(kind):
        items = get_args(kind)
        if items[-1:] != (...,):
            for place, item in enumerate(items):
                yield from _single_values((*steps, str(place)), item, unit)
    elif is_record(kind):
        for name, (item, declaration) in fields(kind).items():
            yield from _single_values((*steps, name), item, declaration.unit)
    else:
        yield steps, unit


def _without_none(hint: Any) -> Any:
    """The one type of an optional tuple or NamedTuple; other types as they are."""
    compound = [part for part in parts(hint) if is_tuple(part) or is_record(part)]
    return compound[0] if compound else hint


def _column(name: str, wires: dict[str, type]) -> Column:
    wire = next((wire for wire in wires if name.startswith(f"{wire}.")), "")
    if not wire:
        near = closest_match(name, [column.name for column in all_columns(wires)])
        near = near or closest_match(".".join(name.split(".")[:2]), wires)
        cause = f"the recording has no field '{name}'; it has the topics {join_words(wires, 'and')}"
        raise _unknown_field(name, cause, near)
    field, *rest = name.removeprefix(f"{wire}.").split(".")
    declared = fields(wires[wire])
    if field not in declared:
        near = closest_match(field, declared)
        cause = f"{wire} carries {type_name(wires[wire])} with {join_words(declared, 'and')}"
        raise _unknown_field(name, cause, None if near is None else f"{wire}.{near}")
    hint, declaration = declared[field]
    unit = _unit_at(hint, rest, declaration.unit)
    if unit is None:
        cause = f"'{'.'.join(rest)}' does not exist in the field '{field}'"
        raise _unknown_field(name, cause, f"{wire}.{field}")
    return Column(name, wire, (field, *rest), unit)


def _unit_at(hint: Any, steps: Sequence[str], unit: str) -> str | None:
    """The unit of what `steps` lead to in a field of type `hint`; None if they lead nowhere."""
    if not steps:
        return unit
    kind, step = _without_none(hint), steps[0]
    if is_tuple(kind) and step.isdecimal():
        items = get_args(kind)
        place = 0 if items[-1:] == (...,) else int(step)
        return _unit_at(items[place], steps[1:], unit) if place < len(items) else None
    if is_record(kind) and step in fields(kind):
        item, declaration = fields(kind)[step]
        return _unit_at(item, steps[1:], declaration.unit)
    return None


def _unknown_field(name: str, cause: str, near: str | None) -> UsageError:
    fix = "" if near is None else f"did you mean {near}?"
    return UsageError(Problem("E-FIELD", name, cause, fix))


class Series(NamedTuple):
    """One field over time: times in s since the start of the run; gaps in the values are nan."""

    name: str
    unit: str
    times: list[float]
    values: list[float]

    def bounds(self) -> tuple[float, float]:
        """Minimum and maximum; (0, 0) when there is no value."""
        values = [value for value in self.values if isfinite(value)]
        return (min(values), max(values)) if values else (0.0, 0.0)


def read_series(
    path: Path, names: Sequence[str], begin: int = 0, until: int = NEVER
) -> list[Series]:
    """The fields called `names` of the recording at `path`, from `begin` to before `until` (ns).

    A topic alone stands for all its fields that are numbers. Raises UsageError for a field that
    does not exist or holds no numbers, RunError for a file that is not a recording.
    """
    columns = choose_columns(names, all_wires(path)[0])
    curves = [Series(column.name, column.unit, [], []) for column in columns]
    for time, row in table_rows(path, columns):
        if not begin <= time < until:
            continue
        for column, curve, value in zip(columns, curves, row, strict=True):
            if isinstance(value, str | tuple):
                if column.name in names:  # asked for by its own name, not as part of a topic
                    cause = f"{column.name} holds texts or lists, not numbers"
                    fix = "see them with bag export"
                    raise UsageError(Problem("E-FIELD", column.name, cause, fix))
            elif value is not None:
                curve.times.append(time / SECOND)
                curve.values.append(float(value) if isfinite(value) else nan)
    drawn = [curve for curve in curves if curve.times]
    if not drawn:
        cause = f"none of {join_words(names)} has a number in that time"
        raise UsageError(Problem("E-FIELD", str(path), cause, "see diffbotctl bag info"))
    return drawn
