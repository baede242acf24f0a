"""Fields of recorded messages by name, such as `odometry.odometry.x`: as table rows or curves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin

from diffbotctl.errors import Problem, UsageError, closest_match, join_words
from diffbotctl.messages import BUILT_IN, fields
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.time import NEVER, SECOND


class Column(NamedTuple):
    """One field of the messages of one topic: `steps` lead from a message to the value."""

    name: str
    wire: str
    steps: tuple[str, ...]
    unit: str

    def of(self, message: Any) -> Any:
        """The field's value in `message`; None where a list is shorter than the index."""
        value = message
        for step in self.steps:
            if step.isdigit():
                value = value[int(step)] if int(step) < len(value) else None
            else:
                value = getattr(value, step)
        return value


def column_wires(path: Path) -> dict[str, type]:
    """Every topic of the run with a message in the recording at `path`, with its message class.

    Raises RunError for a file that is not a recording.
    """
    reader = RecordingReader(path)
    topics = {channel.topic for channel, _ in reader.records()}
    return {wire: BUILT_IN[kind] for wire, (kind, _) in reader.wires.items() if wire in topics}


def choose_columns(names: Sequence[str], wires: dict[str, type]) -> list[Column]:
    """The columns called `names`; a topic alone means all its fields.

    Raises UsageError with the closest name for one that does not exist.
    """
    columns: list[Column] = []
    for name in names:
        columns += _topic_columns(name, wires[name]) if name in wires else [_column(name, wires)]
    return columns


def all_columns(wires: dict[str, type]) -> list[Column]:
    """All fields of all topics."""
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
    columns: list[Column] = []
    for name, (hint, declaration) in fields(kind).items():
        if name == "time":
            continue
        indices: list[tuple[str, ...]] = [()]
        if get_origin(hint) is tuple:
            item_types = get_args(hint)
            if item_types[0] is not float or item_types[-1] is ...:
                continue  # a list of any length makes no columns; its items can be named
            indices = [(str(place),) for place in range(len(item_types))]
        for index in indices:
            steps = (name, *index)
            columns.append(Column(".".join((wire, *steps)), wire, steps, declaration.unit))
    return columns


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
        cause = f"{wire} carries {wires[wire].__name__} with {join_words(declared, 'and')}"
        raise _unknown_field(name, cause, None if near is None else f"{wire}.{near}")
    hint, declaration = declared[field]
    if not _is_path_in(hint, rest):
        cause = f"'{'.'.join(rest)}' does not exist in the field '{field}'"
        raise _unknown_field(name, cause, f"{wire}.{field}")
    return Column(name, wire, (field, *rest), declaration.unit)


def _is_path_in(hint: Any, steps: Sequence[str]) -> bool:
    """Whether `steps`, an index and a field name at most, lead to a value in a `hint`."""
    if not steps:
        return True
    if get_origin(hint) is not tuple or not steps[0].isdigit():
        return False
    item_types = get_args(hint)
    if item_types[-1] is not ... and int(steps[0]) >= len(item_types):
        return False
    return len(steps) == 1 or (
        len(steps) == 2 and steps[1] in getattr(item_types[0], "_fields", ())
    )


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
    columns = choose_columns(names, column_wires(path))
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
