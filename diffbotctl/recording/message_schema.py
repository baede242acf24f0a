"""JSON Schemas of message classes, and message classes from them.

A recording carries the schema of each of its message classes, so that it can also be read where
the package of a class is not installed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from keyword import iskeyword
from math import inf, isfinite
from types import NoneType
from typing import Annotated, Any, Literal, NamedTuple, cast, get_args, get_origin

from diffbotctl.message_types import FIELDS_MAX, NESTING_MAX, is_record, is_tuple, parts, type_name
from diffbotctl.messages import Field, fields
from diffbotctl.recording.json_codec import plain

NAMES: dict[Any, str] = {
    int: "integer",
    float: "number",
    str: "string",
    bool: "boolean",
    NoneType: "null",
}
TYPES = {name: kind for kind, name in NAMES.items()}
TUPLE_ITEMS_MAX = 1000  # of a tuple of fixed length
Schema = dict[str, Any]


def json_schema(kind: type) -> Schema:
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "description": _first_line(kind),
        **_record_schema(kind),
        "title": type_name(kind),
    }


def _first_line(kind: type) -> str:
    text = (kind.__doc__ or "").split("\n")[0]
    return "" if text.startswith(f"{kind.__name__}(") else text  # made by NamedTuple


def _record_schema(kind: type) -> Schema:
    properties = {
        name: {**_hint_schema(hint), "description": field.help, "x-unit": field.unit}
        for name, (hint, field) in fields(kind).items()
    }
    for name, (_, field) in fields(kind).items():
        for keyword, bound in (("minimum", field.minimum), ("maximum", field.maximum)):
            if isfinite(bound):
                properties[name][keyword] = bound
    for name, default in getattr(kind, "_field_defaults", {}).items():
        properties[name]["default"] = plain(default)
    return {"title": kind.__name__, "type": "object", "properties": properties}


def _hint_schema(hint: Any) -> Schema:
    """The schema of a field's type. A fixed tuple states in `items` what viewers understand."""
    options = parts(hint)
    has_none = NoneType in options
    for part in options:
        schema: Schema
        if is_tuple(part):
            schema = _tuple_schema(get_args(part))
        elif is_record(part):
            schema = _record_schema(part)
        elif get_origin(part) is Literal:
            choices = [*get_args(part), None] if has_none else list(get_args(part))
            schema = {"type": "string", "enum": choices}
        else:
            continue
        return {**schema, "type": [schema["type"], "null"]} if has_none else schema
    types = [NAMES[part] for part in options]
    return {"type": types[0] if len(types) == 1 else types}


def _tuple_schema(items: tuple[Any, ...]) -> Schema:
    if not items:
        return {"type": "array", "prefixItems": [], "maxItems": 0}
    schema = {"type": "array", "items": _hint_schema(items[0])}
    if items[-1] is ...:
        return schema
    each = [_hint_schema(item) for item in items]
    return {**schema, "prefixItems": each, "minItems": len(items), "maxItems": len(items)}


def message_class(name: str, text: bytes) -> type:
    """A message class called `name`, such as `my_package/Face`, from its JSON Schema.

    Its `type_name` is `name`. Raises ValueError for a schema that `json_schema` does not make.
    """
    package, _, short_name = name.rpartition("/")
    if package and not package.isidentifier():
        raise ValueError("the package has no valid name")
    try:
        schema = json.loads(text)
        kind = _record(short_name, schema, 0)
    except (KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"its schema is not that of a message ({type(error).__name__})") from error
    if getattr(kind, "_fields", ())[:1] != ("time",) or fields(kind)["time"][0] is not int:
        raise ValueError("its schema has no time")
    kind.__module__ = package or "recorded"
    kind.__doc__ = _text(schema.get("description", ""))
    return kind


def _record(name: str, schema: Schema, depth: int) -> type:
    properties = schema["properties"]
    if depth > NESTING_MAX or len(properties) > FIELDS_MAX:
        raise ValueError("its schema is nested too deeply or has too many fields")
    for word in (name, *properties):
        if not word.isidentifier() or iskeyword(word) or word.startswith("_"):
            raise ValueError(f"its schema has the name {word[:40]!r}")
    hints = [
        (field, Annotated[_hint(each, depth), _field(each)]) for field, each in properties.items()
    ]
    kind: Any = NamedTuple(name, hints)  # type: ignore[misc]
    return cast(type, kind)


def _field(schema: Schema) -> Field:
    minimum, maximum = schema.get("minimum", -inf), schema.get("maximum", inf)
    if not (isinstance(minimum, int | float) and isinstance(maximum, int | float)):
        raise TypeError("a bound is not a number")
    unit, help = _text(schema.get("x-unit", "")), _text(schema.get("description", ""))
    return Field(unit, help, minimum, maximum)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError("not a text")
    return value


def _hint(schema: Schema, depth: int) -> Any:
    if depth > NESTING_MAX:
        raise ValueError("its schema is nested too deeply")
    types = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    options: list[Any] = []
    for name in types:
        if name == "array":
            options.append(_tuple(schema, depth))
        elif name == "object":
            options.append(_record(_text(schema["title"]), schema, depth + 1))
        elif name == "string" and "enum" in schema:
            choices = tuple(_text(choice) for choice in schema["enum"] if choice is not None)
            options.append(Literal[choices])
        else:
            options.append(TYPES[name])
    return _union(options)


def _tuple(schema: Schema, depth: int) -> Any:
    if "prefixItems" not in schema:
        return tuple[_hint(schema["items"], depth + 1), ...]  # type: ignore[misc]
    if len(schema["prefixItems"]) > TUPLE_ITEMS_MAX:
        raise ValueError("its schema has too long a tuple")
    return tuple[tuple(_hint(item, depth + 1) for item in schema["prefixItems"])]  # type: ignore[misc]


def _union(options: Sequence[Any]) -> Any:
    if not options:
        raise ValueError("its schema has a field without a type")
    union = options[0]
    for option in options[1:]:
        union = union | option
    return union
