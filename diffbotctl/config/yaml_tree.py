"""A value of a YAML file, and where it stands.

A parser's events to a tree of values, noting what is wrong on the way.

Nothing here recurses on what a stranger wrote: nesting is counted, and an alias counts with all
that it stands for.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, TypeAlias

from diffbotctl.config.yaml_scalars import ScalarError, resolve
from diffbotctl.errors import Place, Problem, Source

Data: TypeAlias = "bool | int | float | str | dict[str, Value] | list[Value] | None"


class Value:
    """A scalar, mapping or list of a file, with its place and the place of its key.

    `text` is a scalar as it was written, `quoted` whether it stood in quotes. `flow` marks
    `{...}` and `[...]`.
    """

    __slots__ = ("data", "flow", "key", "place", "quoted", "size", "text")

    def __init__(
        self,
        data: Data,
        place: Place,
        key: Place | None = None,
        text: str = "",
        quoted: bool = False,
        flow: bool = False,
        size: int = 1,
    ) -> None:
        self.data = data
        self.place = place
        self.key = key
        self.text = text
        self.quoted = quoted
        self.flow = flow
        self.size = size

    def with_key(self, key: Place | None) -> Value:
        """The same value under another key."""
        return Value(self.data, self.place, key, self.text, self.quoted, self.flow, self.size)

    @property
    def spot(self) -> Place:
        """Where to point when the value as a whole is meant: a block's key stands for it."""
        is_block = isinstance(self.data, dict | list) and not self.flow
        return self.key if self.key and (is_block or not self.text) else self.place

    @property
    def entries(self) -> dict[str, Value]:
        """The entries of a mapping; none for anything else."""
        return self.data if isinstance(self.data, dict) else {}

    @property
    def items(self) -> list[Value]:
        """The items of a list; none for anything else."""
        return self.data if isinstance(self.data, list) else []

    def plain(self) -> Any:
        """The value as plain dictionaries, lists and scalars."""
        if isinstance(self.data, dict):
            return {name: value.plain() for name, value in self.data.items()}
        if isinstance(self.data, list):
            return [value.plain() for value in self.data]
        return self.data

    def with_entry(self, steps: Sequence[str], value: Value) -> Value:
        """A copy of this mapping in which `value` stands at the path `steps`."""
        entries = dict(self.entries)
        name, rest = steps[0], steps[1:]
        if rest:
            below = entries.get(name)
            if below is None or not isinstance(below.data, dict):
                below = Value({}, value.place, value.key)
            value = below.with_entry(rest, value)
        entries[name] = value
        copy = self.with_key(self.key)
        copy.data = entries
        return copy

    def at(self, *steps: str | int) -> Value | None:
        """The value found by keys and indices from here, or None."""
        found: Value | None = self
        for step in steps:
            if isinstance(step, int):
                items = found.items if found else []
                found = items[step] if step < len(items) else None
            else:
                found = found.entries.get(step) if found else None
        return found


DEEPEST = 40  # levels; a robot file has 6
MOST = 20_000  # values after every alias is unfolded; a robot file has about 150


class UnreadableError(Exception):
    """Reading on would be of no use."""


class TreeBuilder:
    """Makes the tree out of events, noting what is wrong on the way."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.problems: list[Problem] = []
        self.root: Value | None = None
        self.stack: list[_Open] = []
        self.anchors: dict[str, Value | None] = {}
        self.documents = 0

    def take(self, event: Any) -> None:
        step = getattr(self, "_" + type(event).__name__.removesuffix("Event").lower(), None)
        if step is not None:
            step(event)

    def _documentstart(self, event: Any) -> None:
        self.documents += 1
        if self.documents > 1:
            cause = "a second document begins here, but a file holds one"
            self._stop("E-YAML-TOP", self._place(event), cause, "remove the `---` line")

    def _mappingstart(self, event: Any) -> None:
        self._open(event, {})

    def _sequencestart(self, event: Any) -> None:
        self._open(event, [])

    def _mappingend(self, event: Any) -> None:
        self._close()

    def _sequenceend(self, event: Any) -> None:
        self._close()

    def _scalar(self, event: Any) -> None:
        self._check_tag(event)
        place, text = self._place(event), event.value
        data: Data = text
        quoted = not event.implicit[0]
        if not quoted and not self._expects_key():
            try:
                data = resolve(text)
            except ScalarError as error:
                self._note("E-YAML-NUMBER", place, str(error), error.fix)
        self._add(Value(data, place, None, text, quoted), event.anchor)

    def _alias(self, event: Any) -> None:
        place, name = self._place(event), event.anchor
        if name not in self.anchors:
            cause = f"*{name} refers to &{name}, which is not defined above"
            self._stop("E-YAML-ANCHOR", place, cause, "write the value itself")
        meant = self.anchors[name]
        if meant is None:
            cause = f"*{name} stands inside the value that it refers to"
            self._stop("E-YAML-ANCHOR", place, cause, "write the value itself")
        assert meant is not None
        copy = meant.with_key(None)
        self._add(copy, None, place)

    def _open(self, event: Any, data: Data) -> None:
        self._check_tag(event)
        value = Value(data, self._place(event), flow=bool(event.flow_style))
        if self._expects_key():
            cause = "a list or mapping cannot be a key"
            self._stop("E-YAML-KEY", value.place, cause, "check for a stray bracket or brace")
        self.stack.append(_Open(value, event.anchor))
        if event.anchor:
            self.anchors[event.anchor] = None
        if len(self.stack) > DEEPEST:
            self.problems.append(too_deep(value.place))
            raise UnreadableError

    def _close(self) -> None:
        done = self.stack.pop()
        self._add(done.value, done.anchor)

    def _expects_key(self) -> bool:
        if not self.stack:
            return False
        return isinstance(self.stack[-1].value.data, dict) and self.stack[-1].key is None

    def _add(self, value: Value, anchor: str | None, place: Place | None = None) -> None:
        if anchor:
            self.anchors[anchor] = value
        if not self.stack:
            self.root = value
            return
        parent = self.stack[-1]
        parent.value.size += value.size
        if parent.value.size > MOST:
            cause = f"this unfolds to more than {MOST} values"
            self._stop("E-YAML-SIZE", place or value.place, cause, "write it without aliases")
        if isinstance(parent.value.data, list):
            parent.value.data.append(value)
        elif parent.key is None:
            self._check_key(parent, value)
            parent.key = value
        else:
            self._store(parent, parent.key, value)
            parent.key = None

    def _check_key(self, parent: _Open, key: Value) -> None:
        if not isinstance(key.data, str):
            cause = "a list or mapping cannot be a key"
            self._stop("E-YAML-KEY", key.place, cause, "check for a stray `*` or bracket")
        if key.text == "<<":
            cause = "merge keys (`<<`) are not read"
            fix = "use `include`, or write what both sides share once in `drive`"
            self._note("E-YAML-KEY", key.place, cause, fix)

    def _store(self, parent: _Open, key: Value, value: Value) -> None:
        entries = parent.value.entries
        if key.text in entries:
            first = entries[key.text].key
            here = first is not None and first.line == key.place.line
            where = "earlier in this line" if here or first is None else f"in line {first.line}"
            cause = f"'{key.text}' is given twice; the first stands {where}"
            self._note("E-YAML-DUPLICATE", key.place, cause, "keep one of them")
            return
        value.key = key.place
        if parent.value.flow and value.data is None and not value.text:
            self._check_comma(entries, key)
        entries[key.text] = value

    def _check_comma(self, entries: dict[str, Value], key: Value) -> None:
        """`{width: 1,5 m}` is two entries: `width: 1` and an empty `5 m`."""
        before = list(entries.values())[-1] if entries else None
        if before is None or not re.match(r"\d", key.text) or not re.search(r"\d\Z", before.text):
            return
        whole = f"{before.text}.{key.text}"
        cause = f"the comma ends the value {before.text}, and '{key.text}' becomes a key of its own"
        self._note("E-YAML-COMMA", key.place, cause, f"write a point: {whole}")

    def _check_tag(self, event: Any) -> None:
        if event.tag is not None and event.tag != "!":
            cause = f"tags such as {event.tag} are not read"
            self._note("E-YAML-TAG", self._place(event), cause, "remove the tag")

    def _place(self, event: Any) -> Place:
        start, end = event.start_mark, event.end_mark
        line = self.source.line(start.line + 1)
        stop = end.column if end.line == start.line else len(line)
        collection = type(event).__name__.endswith("StartEvent")
        length = 1 if collection else max(1, stop - start.column)
        return Place(self.source, start.line + 1, start.column + 1, length)

    def _note(self, code: str, place: Place, cause: str, fix: str) -> None:
        self.problems.append(Problem(code, place, cause, fix))

    def _stop(self, code: str, place: Place, cause: str, fix: str) -> None:
        self._note(code, place, cause, fix)
        raise UnreadableError


class _Open:
    """A mapping or list whose end has not come yet."""

    __slots__ = ("anchor", "key", "value")

    def __init__(self, value: Value, anchor: str | None) -> None:
        self.value = value
        self.anchor = anchor
        self.key: Value | None = None


def too_deep(place: Place) -> Problem:
    """The problem of nesting beyond all measure."""
    return Problem(
        "E-YAML-SIZE",
        place,
        f"this is nested more than {DEEPEST} levels deep",
        "close the brackets that are open",
    )
