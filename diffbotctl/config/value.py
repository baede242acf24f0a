"""A value of a YAML file, and where it stands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from diffbotctl.errors import Place

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
