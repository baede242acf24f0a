"""Messages as JSON and back, exactly: the shortest text of a float reads back as the same float.

JSON has no nan or infinity; they are written as the texts "nan", "inf" and "-inf".
"""

from __future__ import annotations

import json
from collections.abc import Callable
from math import isfinite
from numbers import Integral, Real
from types import NoneType
from typing import Any, Literal, get_args, get_origin

from diffbotctl.message_types import INTEGER_LIMIT, is_record, is_tuple, parts, type_name
from diffbotctl.messages import LOG_LEVELS, LogLevel, fields

Encoder = Callable[[Any], bytes]
# The text of a value that has exactly the type of its field; None for any other one.
Writer = Callable[[Any], str | None]
ENCODER = json.JSONEncoder(allow_nan=False)  # made once: 3 us
NUMBERS = {int, float}


def message_encoder(kind: type) -> Encoder:
    """A function that turns a message of class `kind` into one JSON object."""
    names = list(fields(kind))
    pattern = "{" + ", ".join(f'"{name}": %r' for name in names) + "}"
    n_count = "".join(names).count("n")

    def encode(message: Any) -> bytes:
        return ENCODER.encode(plain(message)).encode()

    def encode_numbers(message: Any) -> bytes:
        # Twelve times faster than json.dumps; 'n' occurs only in nan, inf and field names.
        text: str = pattern % message
        return text.encode() if text.count("n") == n_count else encode(message)

    hints = [hint for hint, _ in fields(kind).values()]
    if all(hint in NUMBERS for hint in hints):
        return encode_numbers
    writers = [writer for writer in map(_writer, hints) if writer is not None]
    if len(writers) < len(hints):
        return encode
    text_pattern = pattern.replace("%r", "%s")

    def encode_fields(message: Any) -> bytes:
        # Five times faster than ENCODER; its results are the same.
        texts = [write(value) for write, value in zip(writers, message, strict=True)]
        return encode(message) if None in texts else (text_pattern % tuple(texts)).encode()

    return encode_fields


def _writer(hint: Any) -> Writer | None:
    """What writes the values of a field of type `hint`; None where only ENCODER can."""
    if hint in WRITERS:
        return WRITERS[hint]
    items = get_args(hint)
    if get_origin(hint) is Literal:
        return _text_of_string if all(type(item) is str for item in items) else None
    if is_tuple(hint):
        return _text_of_numbers if NUMBERS.issuperset(set(items) - {...}) else None
    options = [option for option in parts(hint) if option is not NoneType]
    write = _writer(options[0]) if len(options) == 1 and len(parts(hint)) == 2 else None
    return None if write is None else lambda value: "null" if value is None else write(value)


def _text_of_int(value: Any) -> str | None:
    return repr(value) if type(value) is int else None


def _text_of_float(value: Any) -> str | None:
    return repr(value) if type(value) is float and isfinite(value) else None


def _text_of_bool(value: Any) -> str | None:
    return ("true" if value else "false") if type(value) is bool else None


def _text_of_string(value: Any) -> str | None:
    return json.encoder.encode_basestring_ascii(value) if type(value) is str else None


def _text_of_numbers(values: Any) -> str | None:
    """The text of a tuple of numbers, which `repr` writes as JSON but for nan and infinities."""
    if type(values) is not tuple or not NUMBERS.issuperset(map(type, values)):
        return None
    text = repr(list(values))
    if "n" in text:
        text = text.replace("inf", '"inf"').replace('-"inf"', '"-inf"').replace("nan", '"nan"')
    return text


WRITERS: dict[Any, Writer] = {
    int: _text_of_int,
    float: _text_of_float,
    bool: _text_of_bool,
    str: _text_of_string,
}


def message_decoder(kind: type) -> Callable[[bytes], Any]:
    """A function that turns JSON made by `message_encoder(kind)` back into an equal message.

    The function raises ValueError for anything else, RecursionError for very deep nesting.
    """
    read = message_reader(kind)
    checks = [(name, _type_check(hint)) for name, (hint, _) in fields(kind).items()]

    def decode(data: bytes) -> Any:
        values = json.loads(data)
        try:
            message = read(values)
        except (TypeError, KeyError, AttributeError) as error:
            raise ValueError(f"its fields are not those of {type_name(kind)}") from error
        for (name, is_valid), value in zip(checks, message, strict=True):
            if not is_valid(value):
                raise ValueError(f"the field {name} has a wrong value")
        return message

    return decode


def _type_check(hint: Any) -> Callable[[Any], bool]:
    """Whether a value of a message is one that the field's declaration allows."""
    if hint == LogLevel:
        return lambda value: value in LOG_LEVELS
    options = parts(hint)
    if any(get_origin(part) is Literal or is_tuple(part) or is_record(part) for part in options):
        checks = [_part_check(part) for part in options]
        return checks[0] if len(checks) == 1 else lambda value: any(c(value) for c in checks)
    types = set(options) | ({int} if float in options else set())
    if int not in types:
        return lambda value: type(value) in types
    # Beyond 64 bits no counter of a run can be; arithmetic with larger ones takes ever longer.
    return lambda value: (
        type(value) in types and (type(value) is not int or -INTEGER_LIMIT <= value < INTEGER_LIMIT)
    )


def _part_check(part: Any) -> Callable[[Any], bool]:
    """As `_type_check`, for one type of a union."""
    if get_origin(part) is Literal:  # another version may have other states
        return lambda value: type(value) is str
    if is_tuple(part):
        return _tuple_check(get_args(part))
    if is_record(part):
        checks = [_type_check(hint) for hint, _ in fields(part).values()]
        return lambda value: (
            type(value) is part
            and all(check(item) for check, item in zip(checks, value, strict=True))
        )
    return lambda value: type(value) is part


def _tuple_check(items: tuple[Any, ...]) -> Callable[[Any], bool]:
    if items[-1:] == (...,):
        is_item = _type_check(items[0])
        return lambda value: type(value) is tuple and all(map(is_item, value))
    checks = [_type_check(item) for item in items]
    return lambda value: (
        type(value) is tuple
        and len(value) == len(checks)
        and all(check(item) for check, item in zip(checks, value, strict=True))
    )


def message_reader(kind: type) -> Callable[[dict[str, Any]], Any]:
    """A function that turns the result of `plain` for a message of class `kind` back into it."""
    converters = {name: _converter(hint) for name, (hint, _) in fields(kind).items()}
    changed = [(name, convert) for name, convert in converters.items() if convert is not None]

    def read(values: dict[str, Any]) -> Any:
        for name, convert in changed:
            if name in values:  # a field that was added later has a default
                values[name] = convert(values[name])
        return kind(**values)

    return read


def _converter(hint: Any) -> Callable[[Any], Any] | None:
    """A function from a JSON value to the field's value; None where they are the same."""
    options = parts(hint)
    if float in options:
        return _number
    for part in options:
        if is_tuple(part) or is_record(part):
            convert = _tuple_converter(get_args(part)) if is_tuple(part) else message_reader(part)
            # The type check refuses None where the declaration does not allow it.
            return lambda value: None if value is None else convert(value)
    return None


def _tuple_converter(items: tuple[Any, ...]) -> Callable[[Any], tuple[Any, ...]]:
    if items[-1:] == (...,):
        convert = _converter(items[0])
        return lambda values: tuple(values) if convert is None else tuple(map(convert, values))
    converters = [_converter(item) or _same for item in items]
    return lambda values: tuple(
        convert(value) for convert, value in zip(converters, values, strict=True)
    )


def _same(value: Any) -> Any:
    return value


def plain(value: Any) -> Any:
    """A message, or a value in it, as JSON types; nan and infinities as texts."""
    if isinstance(value, float):
        return float(value) if isfinite(value) else repr(float(value))
    if hasattr(value, "_asdict"):
        return {name: plain(item) for name, item in value._asdict().items()}
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    if value is None or isinstance(value, int | str):
        return value
    return _plain_number(value)


def _plain_number(value: Any) -> Any:
    """A number of another library, such as NumPy, as JSON types."""
    if isinstance(value, Integral):
        return int(value)
    return plain(float(value)) if isinstance(value, Real) else value


def _number(value: Any) -> Any:
    return float(value) if isinstance(value, str) else value
