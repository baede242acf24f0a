"""Fields of recorded messages by the name a person types: `odometry.odometry.x`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin

from diffbotctl.bags.source import messages, readable, whole
from diffbotctl.engine.replay import Recorded
from diffbotctl.errors import Problem, UsageError, listed, nearest
from diffbotctl.hub.recording import RecordingReader
from diffbotctl.messages import BUILT_IN, fields


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


def wires(path: Path) -> dict[str, type]:
    """Every topic of the run that spoke in the recording at `path`, with its message class.

    Raises RunError for a file that is no recording.
    """
    reader = RecordingReader(path)
    with readable(path):
        spoke = {channel.topic for channel, _ in reader.records()}
    whole(reader)
    return {wire: BUILT_IN[kind] for wire, (kind, _) in reader.wires.items() if wire in spoke}


def chosen(names: Sequence[str], known: dict[str, type]) -> list[Column]:
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


def everything(known: dict[str, type]) -> list[Column]:
    """All fields of all topics."""
    return [column for wire, kind in known.items() for column in _all_of(wire, kind)]


def rows(path: Path, columns: Sequence[Column]) -> Iterator[tuple[int, list[Any]]]:
    """(logical time in ns, one value a column or None) for each instant with one of `columns`."""
    by_wire: dict[str, list[tuple[int, Column]]] = {}
    for place, column in enumerate(columns):
        by_wire.setdefault(column.wire, []).append((place, column))
    for time, items in _instants(item for item in messages(path) if item.wire in by_wire):
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
        near = nearest(name, [column.name for column in everything(known)])
        near = near or nearest(".".join(name.split(".")[:2]), known)
        cause = f"the recording has no field '{name}'; it has the topics {listed(known, 'and')}"
        raise _unknown(name, cause, near)
    own = fields(known[wire])
    if parts[1] not in own:
        near = nearest(parts[1], own)
        cause = f"{wire} carries {known[wire].__name__} with {listed(own, 'and')}"
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
