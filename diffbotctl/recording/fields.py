"""Fields of recorded messages by the name a person types: `odometry.odometry.x`.

Recorded fields as curves over time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin

from diffbotctl.errors import Problem, UsageError, closest_match, join_words
from diffbotctl.messages import BUILT_IN, fields
from diffbotctl.recording.info import readable_recording, recorded_messages, require_complete
from diffbotctl.recording.mcap_file import RecordingReader
from diffbotctl.recording.replay_driver import Recorded
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
    """Every topic of the run that spoke in the recording at `path`, with its message class.

    Raises RunError for a file that is no recording.
    """
    reader = RecordingReader(path)
    with readable_recording(path):
        spoke = {channel.topic for channel, _ in reader.records()}
    require_complete(reader)
    return {wire: BUILT_IN[kind] for wire, (kind, _) in reader.wires.items() if wire in spoke}


def choose_columns(names: Sequence[str], known: dict[str, type]) -> list[Column]:
    """The columns called `names`; a topic alone means all its fields.

    Raises UsageError with the nearest name for one that is not there.
    """
    found: list[Column] = []
    for name in names:
        if name in known:
            found += _all_of(name, known[name])
        else:
            found.append(_column(name, known))
    return found


def all_columns(known: dict[str, type]) -> list[Column]:
    """All fields of all topics."""
    return [column for wire, kind in known.items() for column in _all_of(wire, kind)]


def table_rows(path: Path, columns: Sequence[Column]) -> Iterator[tuple[int, list[Any]]]:
    """(logical time in ns, one value a column or None) for each instant with one of `columns`."""
    by_wire: dict[str, list[tuple[int, Column]]] = {}
    for place, column in enumerate(columns):
        by_wire.setdefault(column.wire, []).append((place, column))
    for time, items in _instants(item for item in recorded_messages(path) if item.wire in by_wire):
        row: list[Any] = [None] * len(columns)
        for item in items:
            for place, column in by_wire[item.wire]:
                row[place] = column.of(item.message)
        yield time, row


def _instants(recorded: Iterable[Recorded]) -> Iterator[tuple[int, list[Recorded]]]:
    waiting: list[Recorded] = []
    for item in recorded:
        if waiting and waiting[0].instant != item.instant:
            yield waiting[0].time, waiting
            waiting = []
        waiting.append(item)
    if waiting:
        yield waiting[0].time, waiting


def _all_of(wire: str, kind: type) -> list[Column]:
    found: list[Column] = []
    for name, (hint, about) in fields(kind).items():
        if name == "time":
            continue
        ends: list[tuple[str, ...]] = [()]
        if get_origin(hint) is tuple:
            inside = get_args(hint)
            if inside[0] is not float or inside[-1] is ...:
                continue  # a list of any length makes no columns; name its items one by one
            ends = [(str(place),) for place in range(len(inside))]
        for end in ends:
            steps = (name, *end)
            found.append(Column(".".join((wire, *steps)), wire, steps, about.unit))
    return found


def _column(name: str, known: dict[str, type]) -> Column:
    wire = next((each for each in known if name.startswith(f"{each}.")), "")
    parts = [wire, *name.removeprefix(f"{wire}.").split(".")]
    if not wire:
        near = closest_match(name, [column.name for column in all_columns(known)])
        near = near or closest_match(".".join(name.split(".")[:2]), known)
        cause = f"the recording has no field '{name}'; it has the topics {join_words(known, 'and')}"
        raise _unknown(name, cause, near)
    own = fields(known[wire])
    if parts[1] not in own:
        near = closest_match(parts[1], own)
        cause = f"{wire} carries {known[wire].__name__} with {join_words(own, 'and')}"
        raise _unknown(name, cause, None if near is None else f"{wire}.{near}")
    column = Column(name, wire, tuple(parts[1:]), own[parts[1]][1].unit)
    if not _leads_somewhere(own[parts[1]][0], parts[2:]):
        cause = f"'{'.'.join(parts[2:])}' leads nowhere in the field '{parts[1]}'"
        raise _unknown(name, cause, ".".join(parts[:2]))
    return column


def _leads_somewhere(hint: Any, steps: Sequence[str]) -> bool:
    if not steps:
        return True
    if get_origin(hint) is not tuple or not steps[0].isdigit():
        return False
    inside = get_args(hint)
    if inside[-1] is not ... and int(steps[0]) >= len(inside):
        return False
    kind = inside[0]
    if len(steps) == 1:
        return True
    return hasattr(kind, "_fields") and len(steps) == 2 and steps[1] in kind._fields


def _unknown(name: str, cause: str, near: str | None) -> UsageError:
    fix = "" if near is None else f"did you mean {near}?"
    return UsageError(Problem("E-FIELD", name, cause, fix))


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
    known = column_wires(path)
    columns = choose_columns(names, known)
    found = [Series(column.name, column.unit, [], []) for column in columns]
    words: set[int] = set()
    for time, row in table_rows(path, columns):
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
        cause = f"none of {join_words(names)} has a number in that time"
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
