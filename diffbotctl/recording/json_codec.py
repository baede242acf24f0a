"""Messages as JSON and back, exactly: the shortest text of a float reads back as the same float.

JSON has no nan or infinity; they are written as the texts "nan", "inf" and "-inf".
"""

from __future__ import annotations

import json
from collections.abc import Callable
from math import isfinite
from typing import Any, Literal, get_args, get_origin

from diffbotctl.messages import Field, Goal, fields

Encoder = Callable[[Any], bytes]


def message_encoder(kind: type) -> Encoder:
    """A function that turns a message of class `kind` into one JSON object."""
    names = list(fields(kind))
    pattern = "{" + ", ".join(f'"{name}": %r' for name in names) + "}"
    n_count = "".join(names).count("n")

    def encode(message: Any) -> bytes:
        return json.dumps(plain(message), allow_nan=False).encode()

    def encode_numbers(message: Any) -> bytes:
        # Twelve times faster than json.dumps; 'n' occurs only in nan, inf and field names.
        text: str = pattern % message
        return text.encode() if text.count("n") == n_count else encode(message)

    is_simple = all(hint in (int, float) for hint, _ in fields(kind).values())
    return encode_numbers if is_simple else encode


def message_decoder(kind: type) -> Callable[[bytes], Any]:
    """A function that turns JSON made by `message_encoder(kind)` back into an equal message."""
    read = message_reader(kind)

    def decode(data: bytes) -> Any:
        return read(json.loads(data))

    return decode


def message_reader(kind: type) -> Callable[[dict[str, Any]], Any]:
    """A function that turns the result of `plain` for a message of class `kind` back into it."""
    floats = {name for name, (hint, _) in fields(kind).items() if float in _parts(hint)}
    tuples = {name for name, (hint, _) in fields(kind).items() if _is_tuple(hint)}

    def read(values: dict[str, Any]) -> Any:
        for name in floats:
            values[name] = _number(values[name])
        for name in tuples:
            values[name] = tuple(_goal(item) for item in values[name])
        return kind(**values)

    return read


def json_schema(kind: type) -> dict[str, Any]:
    """The JSON Schema of a message class, from its field declarations."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": kind.__name__,
        "description": (kind.__doc__ or "").split("\n")[0],
        "type": "object",
        "properties": {
            name: _property(hint, field) for name, (hint, field) in fields(kind).items()
        },
    }


def _property(hint: Any, field: Field) -> dict[str, Any]:
    common: dict[str, Any] = {"description": field.help, "x-unit": field.unit}
    if _is_tuple(hint):
        item_type = get_args(hint)[0]
        items = {"type": "number"} if item_type is float else {"type": "object"}
        return {"type": "array", "items": items, **common}
    if get_origin(hint) is Literal:
        return {"type": "string", "enum": list(get_args(hint)), **common}
    names = {int: "integer", float: "number", str: "string", bool: "boolean", type(None): "null"}
    types = [names[part] for part in _parts(hint)]
    return {"type": types[0] if len(types) == 1 else types, **common}


def _parts(hint: Any) -> tuple[Any, ...]:
    return (hint,) if isinstance(hint, type) and not _is_tuple(hint) else get_args(hint)


def _is_tuple(hint: Any) -> bool:
    return get_origin(hint) is tuple


def plain(value: Any) -> Any:
    """A message, or a value in it, as JSON types; nan and infinities as texts."""
    if isinstance(value, float):
        return value if isfinite(value) else repr(value)
    if hasattr(value, "_asdict"):
        return {name: plain(item) for name, item in value._asdict().items()}
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    return value


def _number(value: Any) -> Any:
    return float(value) if isinstance(value, str) else value


def _goal(item: Any) -> Any:
    return Goal(**item) if isinstance(item, dict) else _number(item)
