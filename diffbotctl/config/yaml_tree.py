"""Values of a YAML file as a tree; each value knows its place in the file.

YAML 1.1 turns `on` into true, `12:30` into 750, `017` into 15 and `1e-3` into text. Here an
unquoted word is a number when it looks like a decimal number, a boolean when it is true or false,
and otherwise text.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from diffbotctl.errors import Place
from diffbotctl.units import NUMBER

Scalar: TypeAlias = bool | int | float | str | None
Data: TypeAlias = "Scalar | dict[str, Value] | list[Value]"

INTEGER = re.compile(r"[-+]?[0-9]+\Z")
DECIMAL = re.compile(NUMBER + r"\Z")
NOT_DECIMAL = re.compile(r"[-+]?(0[0-9_]+|0o[0-7_]+|0x[0-9a-fA-F_]+|0b[01_]+)\Z")
NUMBER_MAX_LENGTH = 40  # characters; longer ones are slow to convert
KEYWORDS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


class ScalarError(ValueError):
    """A word looks like a number but cannot be one; `fix` says how to write it."""

    def __init__(self, cause: str, fix: str) -> None:
        super().__init__(cause)
        self.fix = fix


def resolve(text: str) -> Scalar:
    """The value of the unquoted `text`.

    Raises ScalarError for octal, hexadecimal and binary numbers, which readers of YAML disagree
    about, and for numbers too large to hold.
    """
    if text in KEYWORDS:
        return KEYWORDS[text]
    if NOT_DECIMAL.match(text):
        raise ScalarError(
            f"'{text}' is read as {_other_reading(text)} by some programs and not by others",
            "write the number in decimal, without leading zeros",
        )
    if not DECIMAL.match(text):
        return text
    number = float(text)
    if len(text) > NUMBER_MAX_LENGTH or abs(number) == float("inf"):
        raise ScalarError("this number is too large", "check the number of digits")
    return int(text) if INTEGER.match(text) else number


def _other_reading(text: str) -> str:
    digits = text.lower().replace("_", "")
    has_prefix = digits.strip("+-0")[:1] in ("o", "x", "b")
    try:
        return str(int(digits, 0 if has_prefix else 8))
    except ValueError:
        return "an octal number"


@dataclass(slots=True, eq=False)
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
        """The items of a list; none for anything else."""
        return self.data if isinstance(self.data, list) else []

    def plain(self) -> Any:
        """The value as plain dictionaries, lists and scalars."""
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

    def with_entry(self, steps: Sequence[str], value: Value) -> Value:
        """A copy of this mapping in which `value` is at the path `steps`."""
        name, rest = steps[0], steps[1:]
        if rest:
            inner = self.entries.get(name)
            if inner is None or not isinstance(inner.data, dict):
                inner = Value({}, value.value_place, value.key_place)
            value = inner.with_entry(rest, value)
        return replace(self, data={**self.entries, name: value})

    def merged_over(self, base: Value) -> Value:
        """This value over `base`: mappings are merged, everything else is replaced."""
        if not isinstance(base.data, dict) or not isinstance(self.data, dict):
            return self
        merged = {
            name: value.merged_over(base.data[name]) if name in base.data else value
            for name, value in self.data.items()
        }
        return replace(self, data={**base.data, **merged})
