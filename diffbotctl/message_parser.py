"""Reads messages from JSON that another program wrote: every field is checked by its declaration.

Recordings are read by `recording.json_codec`, which accepts what an earlier version has written.
"""

import sys
from collections.abc import Callable
from math import inf, isfinite, isnan
from types import NoneType
from typing import Any, Literal, get_args, get_origin

from diffbotctl.message_types import INTEGER_LIMIT, is_record, is_tuple, parts, type_name
from diffbotctl.messages import FINITE, Field, fields
from diffbotctl.units import UnitError, quantity

TEXT_MAX_LENGTH = 10_000  # characters
INFINITIES = {"inf": inf, "-inf": -inf}
USUAL_LIMITS: dict[Any, tuple[float, float]] = {  # of a text: its length
    float: (-sys.float_info.max, sys.float_info.max),
    int: (-INTEGER_LIMIT, INTEGER_LIMIT - 1),
    bool: (0, 1),
    str: (0, TEXT_MAX_LENGTH),
}

Reader = Callable[[Any, str], Any]


class MessageError(ValueError):
    """Fields that are no message of the class; the text names the field and what is wrong."""


Parser = Callable[..., Any]  # of a JSON object, and of the time of the message in ns


def message_parser(kind: type, with_units: bool = False) -> Parser:
    """A function that turns a JSON object into a message of class `kind`.

    `time` may be left out and is ignored: the receiver stamps the message, with the second argument
    of the function or 0. A field with a default may be left out. Numbers are finite and within the
    bounds of their field; where a field has no bounds and the class allows it, the texts "inf" and
    "-inf" are infinities.
    `with_units`: a text with a unit is a number too, as in files. The function raises MessageError.
    """
    read = _record_reader(kind, kind in FINITE, with_units)
    read_usual = _usual_reader(kind)

    def parse(values: dict[str, Any], time: int = 0) -> Any:
        if read_usual is not None:
            message = read_usual(values, time)
            if message is not None:
                return message
        return read({**values, "time": time}, "")

    return parse


def _usual_reader(kind: type) -> Callable[[dict[str, Any], int], Any] | None:
    """A short way for messages with exactly their fields, all numbers, texts and truth values.

    The function returns None for all others. None where a field of the class is something else.
    """
    declared = fields(kind)
    place = list(declared).index("time")
    checks: list[tuple[str, Any, float, float]] = []
    for name, (hint, field) in declared.items():
        if name == "time":
            continue
        if hint not in USUAL_LIMITS:
            return None
        minimum, maximum = USUAL_LIMITS[hint]
        checks.append((name, hint, max(minimum, field.minimum), min(maximum, field.maximum)))
    count, make = len(checks), kind._make  # type: ignore[attr-defined]

    def read(values: dict[str, Any], time: int) -> Any:
        if len(values) != count:
            return None
        found: list[Any] = []
        for name, hint, minimum, maximum in checks:
            value: Any = values.get(name)
            if type(value) is not hint:
                return None
            if not minimum <= (len(value) if hint is str else value) <= maximum:
                return None
            found.append(value)
        found.insert(place, time)
        return make(found)

    return read


def _record_reader(kind: type, is_finite: bool, with_units: bool) -> Reader:
    declared = fields(kind)
    readers = {
        name: _reader(hint, field, is_finite, with_units)
        for name, (hint, field) in declared.items()
    }
    defaults = getattr(kind, "_field_defaults", {})

    def read(value: Any, path: str) -> Any:
        if not isinstance(value, dict):
            raise MessageError(f"{path or type_name(kind)} must be an object")
        for name in value:
            if name not in readers:
                raise MessageError(
                    f"there is no field '{str(name)[:40]}' in {type_name(kind)}; "
                    f"it has {', '.join(readers)}"
                )
        values = {}
        for name, reader in readers.items():
            inner = f"{path}.{name}" if path else name
            if name in value:
                values[name] = reader(value[name], inner)
            elif name not in defaults:
                raise MessageError(f"{inner} is missing")
        return kind(**values)

    return read


def _reader(hint: Any, field: Field, is_finite: bool, with_units: bool) -> Reader:
    options = parts(hint)
    compound = next((part for part in options if _is_compound(part)), None)
    if compound is not None:
        inner = _compound_reader(compound, field, is_finite, with_units)
        return _or_none(inner) if NoneType in options else inner
    types = set(options)

    def read(value: Any, path: str) -> Any:
        if float in types and not isinstance(value, bool):
            value = _number(value, path, field, is_finite, with_units)
        if type(value) not in types and not (type(value) is int and float in types):
            raise MessageError(f"{path} must be {_words(types)}")
        if type(value) is int and not -INTEGER_LIMIT <= value < INTEGER_LIMIT:
            raise MessageError(f"{path} has more than 64 bits")
        if type(value) is str and len(value) > TEXT_MAX_LENGTH:
            raise MessageError(f"{path} has more than {TEXT_MAX_LENGTH} characters")
        is_number = type(value) in (int, float)
        if is_number and not field.minimum <= value <= field.maximum:
            raise MessageError(
                f"{path} must be {field.minimum:g} to {field.maximum:g} {field.unit}".rstrip()
                + f"; it is {value:g}"
            )
        return value

    return read


def _number(value: Any, path: str, field: Field, is_finite: bool, with_units: bool) -> Any:
    """A number from its JSON; other values as they are."""
    if isinstance(value, str) and value in INFINITIES:
        value = INFINITIES[value]
    elif isinstance(value, str) and with_units:
        try:
            return quantity(value, field.unit)
        except UnitError as error:
            raise MessageError(f"{path}: {error}") from None
    has_bounds = field.minimum > -inf or field.maximum < inf
    if isinstance(value, float) and (
        isnan(value) or ((is_finite or has_bounds) and not isfinite(value))
    ):
        raise MessageError(f"{path} is {value}, not a finite number")
    return value


def _is_compound(part: Any) -> bool:
    return is_tuple(part) or is_record(part) or get_origin(part) is Literal


def _compound_reader(part: Any, field: Field, is_finite: bool, with_units: bool) -> Reader:
    if is_record(part):
        return _record_reader(part, is_finite, with_units)
    if is_tuple(part):
        return _tuple_reader(get_args(part), field, is_finite, with_units)
    choices = get_args(part)

    def read_choice(value: Any, path: str) -> Any:
        if not isinstance(value, str) or value not in choices:
            raise MessageError(f"{path} must be one of {', '.join(choices)}")
        return value

    return read_choice


def _tuple_reader(
    items: tuple[Any, ...], field: Field, is_finite: bool, with_units: bool
) -> Reader:
    is_variable = items[-1:] == (...,)
    readers = [_reader(item, field, is_finite, with_units) for item in items if item is not ...]

    def read(value: Any, path: str) -> Any:
        if not isinstance(value, list) or not (is_variable or len(value) == len(readers)):
            count = "" if is_variable else f" of {len(readers)}"
            raise MessageError(f"{path} must be a list{count}")
        each = readers * len(value) if is_variable else readers
        return tuple(
            reader(item, f"{path}.{place}")
            for place, (reader, item) in enumerate(zip(each, value, strict=True))
        )

    return read


def _or_none(read: Reader) -> Reader:
    return lambda value, path: None if value is None else read(value, path)


def _words(types: set[type]) -> str:
    names = {
        float: "a number",
        int: "a whole number",
        bool: "true or false",
        str: "a text",
        NoneType: "null",
    }
    return " or ".join(word for kind, word in names.items() if kind in types)
