"""Values of a YAML file as a tree; each value knows its place in the file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from diffbotctl.errors import Place

Scalar: TypeAlias = bool | int | float | str | None
Data: TypeAlias = "Scalar | dict[str, Value] | list[Value]"


@dataclass(slots=True, eq=False, repr=False)
class Value:
    """A scalar, mapping or list of a file, with its place and the place of its key.

    `text` is a scalar as it was written, `quoted` whether it was in quotes, `flow` marks `{...}`
    and `[...]`, `size` counts the values in it with every alias expanded.
    """

    data: Data
    value_place: Place
    key_place: Place | None = None
    text: str = ""
    quoted: bool = False
    flow: bool = False
    size: int = 1

    @property
    def place(self) -> Place:
        """The place to show in a message; for an indented block it is the place of its key."""
        is_block = isinstance(self.data, dict | list) and not self.flow
        if self.key_place and (is_block or not self.text):
            return self.key_place
        return self.value_place

    @property
    def name_place(self) -> Place:
        """The place of its key, for a message about the key; its own place where it has none."""
        return self.key_place or self.value_place

    @property
    def entries(self) -> dict[str, Value]:
        """The entries of a mapping; none for anything else."""
        return self.data if isinstance(self.data, dict) else {}

    @property
    def items(self) -> list[Value]:
        return self.data if isinstance(self.data, list) else []

    def plain(self) -> Any:
        if isinstance(self.data, dict):
            return {name: value.plain() for name, value in self.data.items()}
        if isinstance(self.data, list):
            return [value.plain() for value in self.data]
        return self.data

    def at(self, *steps: str | int) -> Value | None:
        """The value at a path of keys and indices, or None."""
        value: Value | None = self
        for step in steps:
            if value is None:
                return None
            if isinstance(step, str):
                value = value.entries.get(step)
            else:
                value = value.items[step] if step < len(value.items) else None
        return value

    def with_entry(self, steps: Sequence[str], value: Value | None) -> Value:
        """A copy of this mapping in which `value` is at the path `steps`; None removes it.

        A step of digits is the index of an item that a list has.
        """
        name, rest = steps[0], steps[1:]
        index = int(name) if name.isdecimal() and len(name) < 6 else len(self.items)
        if index < len(self.items) and value is not None:
            items = list(self.items)
            items[index] = items[index].with_entry(rest, value) if rest else value
            return replace(self, data=items)
        if rest:
            inner = self.entries.get(name)
            if inner is None or not isinstance(inner.data, dict | list):
                place = value or self
                inner = Value({}, place.value_place, place.key_place)
            value = inner.with_entry(rest, value)
        entries = {key: entry for key, entry in self.entries.items() if value or key != name}
        return replace(self, data={**entries, name: value} if value else entries)

    def merged_over(self, base: Value) -> Value:
        """This value over `base`: mappings are merged, everything else is replaced."""
        if not isinstance(base.data, dict) or not isinstance(self.data, dict):
            return self
        merged = {
            name: value.merged_over(base.data[name]) if name in base.data else value
            for name, value in self.data.items()
        }
        return replace(self, data={**base.data, **merged})
