"""The JSON form of a snapshot in a file, from which nothing but plain objects can be made.

It is a list of objects, each a list that begins with its class. Values in an object are null, truth
values, numbers and texts, or [index], a reference to an earlier object of the list, so that shared
objects stay shared and none contains itself. The last object is the whole state:

    [["tuple", 0.5, 7], ["diffbotctl.messages:Twist", 7, 0.1, 0.0], ["dict", "a", [0], "b", [1]]]

A NamedTuple has its fields, a member of an enumeration its name, a subclass of a number or text its
value, and any other class the names and values of its attributes, which `__reduce_ex__(2)` gives
for a compiled class too. Bytes are in base64. Floats are exact; nan and infinities are as in
Python's json.
"""

from __future__ import annotations

import copyreg
import json
from base64 import b64decode, b64encode
from collections import deque
from collections.abc import Callable, Iterator
from enum import Enum
from typing import Any

from diffbotctl.recording.snapshot import StateError

# A robot's state has a thousand objects, ten deep, in 100 kB. A value that is used twice counts
# twice: comparing or hashing it takes that long.
BYTES_MAX = 2 << 20
OBJECTS_MAX = 50_000
DEPTH_MAX = 50
VALUES_MAX = 1_000_000

NUMBERS_AND_TEXTS = (int, float, str)  # and their subclasses, such as a Pin
PLAIN = (bool, int, float, str, type(None))
COLLECTIONS: dict[str, type] = {
    kind.__name__: kind for kind in (list, tuple, set, frozenset, bytes, bytearray)
}
FindClass = Callable[[str, str], type]
"""The class of this module and name. Raises StateError for one that is not restored."""


def to_json(state: Any, find_class: FindClass | None = None) -> bytes:
    """The JSON form of `state`. Raises StateError for what it cannot hold, such as a function.

    `find_class`, of the reader, refuses the classes that could not be restored.
    """
    writer = _Writer(find_class)
    writer.value(state, 0)
    _require(len(writer.objects), OBJECTS_MAX, "objects")
    data = json.dumps(writer.objects, separators=(",", ":")).encode()
    _require(len(data), BYTES_MAX, "bytes")
    return data


def from_json(data: bytes, find_class: FindClass) -> Any:
    """The state whose JSON form is `data`. Raises StateError.

    No class is called: its objects are made empty and get their attributes.
    """
    _require(len(data), BYTES_MAX, "bytes")
    try:
        entries = json.loads(data)
        if type(entries) is not list or not entries:
            raise StateError("it is no list of objects")
        _require(len(entries), OBJECTS_MAX, "objects")
        reader = _Reader(find_class)
        for entry in entries:
            reader.add(*entry)
    except StateError:
        raise
    except Exception as error:  # a damaged text can raise anything
        raise StateError(f"it is damaged ({type(error).__name__})") from error
    return reader.objects[-1]


class _Writer:
    """Appends to `objects` all objects in a value, each after those in it."""

    def __init__(self, find_class: FindClass | None) -> None:
        self.find_class = find_class
        self.objects: list[list[Any]] = []
        self.indices: dict[int, int] = {}  # by id
        self.originals: list[Any] = []  # keeps the ids valid

    def value(self, value: Any, depth: int) -> Any:
        """A plain value itself, or the reference to an object, which is in `depth` others."""
        if type(value) in PLAIN:
            return value
        _require(depth, DEPTH_MAX - 1, "levels")
        index = self.indices.get(id(value))
        if index is None:
            parts = [self.value(part, depth + 1) for part in _parts(value)]
            name = _name(type(value))
            if ":" in name and self.find_class is not None:
                self.find_class(*name.split(":"))
            self.objects.append([name, *parts])
            self.originals.append(value)
            index = self.indices[id(value)] = len(self.objects) - 1
        return [index]


def _name(kind: type) -> str:
    if kind in COLLECTIONS.values() or kind in (dict, deque):
        return kind.__name__
    return f"{kind.__module__}:{kind.__qualname__}"


def _parts(value: Any) -> Iterator[Any]:
    """What the entry of an object holds after its class."""
    match value:
        case bytes() | bytearray():
            yield b64encode(value).decode()
        case dict() if type(value) is dict:
            for key, item in value.items():
                yield key
                yield item
        case deque():
            yield value.maxlen
            yield from value
        case Enum():
            yield value.name
        case int() | float() | str():
            yield next(base(value) for base in NUMBERS_AND_TEXTS if isinstance(value, base))
        case list() | tuple() | set() | frozenset():
            yield from value
        case _:
            for name, item in _attributes(value).items():
                yield name
                yield item


def _attributes(value: Any) -> dict[str, Any]:
    """The attributes of an object, in `__dict__`, in slots, or of a compiled class."""
    make, arguments, *rest = value.__reduce_ex__(2)
    state, *further = rest or [None]
    if make is not copyreg.__newobj__ or len(arguments) > 1 or any(further):  # type: ignore[attr-defined]
        raise StateError(f"it holds a {_name(type(value))}, which has no JSON form")
    in_dict, in_slots = state if isinstance(state, tuple) else (state, None)
    return {**(in_dict or {}), **(in_slots or {})}


class _Reader:
    """Makes the objects, one after the other."""

    def __init__(self, find_class: FindClass) -> None:
        self.find_class = find_class
        self.objects: list[Any] = []
        self.depths: list[int] = []
        self.counts: list[int] = []  # of the values in each object, and in those in it

    def add(self, name: str, *parts: Any) -> None:
        indices = [_index(part, len(self.objects)) for part in parts if type(part) is list]
        depth = 1 + max((self.depths[index] for index in indices), default=0)
        count = 1 + len(parts) + sum(self.counts[index] for index in indices)
        _require(depth, DEPTH_MAX, "levels")
        _require(count, VALUES_MAX, "values")
        values = [self.objects[part[0]] if type(part) is list else part for part in parts]
        self.objects.append(self._object(name, values))
        self.depths.append(depth)
        self.counts.append(count)

    def _object(self, name: str, values: list[Any]) -> Any:
        if name in ("bytes", "bytearray"):
            return COLLECTIONS[name](b64decode(values[0]))
        if name in COLLECTIONS:
            return COLLECTIONS[name](values)
        if name == "dict":
            return dict(_pairs(values))
        if name == "deque":
            return deque(values[1:], values[0])
        kind: Any = self.find_class(*name.split(":"))
        if issubclass(kind, Enum):
            return kind[values[0]]
        for base in NUMBERS_AND_TEXTS:
            if issubclass(kind, base):
                return base.__new__(kind, base(values[0]))
        if issubclass(kind, tuple):
            return tuple.__new__(kind, _checked_fields(kind, values))
        made = kind.__new__(kind)  # a compiled class refuses object.__new__
        for attribute, value in _pairs(values):
            if attribute.startswith("__"):
                raise StateError(f"it sets {attribute[:40]} of a {name[:80]}")
            object.__setattr__(made, attribute, value)
        return made


def _index(reference: list[Any], end: int) -> int:
    """The index in a reference, which is below `end`."""
    (index,) = reference
    if type(index) is not int or not 0 <= index < end:
        raise StateError("it refers to an object that does not precede")
    return index


def _pairs(values: list[Any]) -> Iterator[tuple[Any, Any]]:
    return zip(values[::2], values[1::2], strict=True)


def _checked_fields(kind: Any, values: list[Any]) -> list[Any]:
    if len(values) != len(kind._fields):
        raise StateError(f"it holds a {kind.__qualname__} with {len(values)} fields")
    return values


def _require(number: int, limit: int, unit: str) -> None:
    if number > limit:
        raise StateError(f"it has more than {limit} {unit}")
