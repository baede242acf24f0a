"""Does a file have the right shape? jsonschema decides; the answer is said in our words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from diffbotctl.config import validation_cache
from diffbotctl.config.schema import Schema
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Problem, closest_match, join_words


def check(value: Value, schema: Schema, where: str) -> list[Problem]:
    """What keeps the mapping `value` from having the shape `schema`; `where` names it in words.

    What is wrong inside a scalar is said by the typed reader, which knows its unit.
    """
    plain = value.plain()
    key = validation_cache.key(schema, plain)
    if validation_cache.holds(key):
        return []
    from jsonschema import Draft202012Validator

    errors = list(Draft202012Validator(schema).iter_errors(plain))
    problems: list[Problem] = []
    for error in errors:
        problems += _translated(error, value, where)
    if not errors:
        validation_cache.remember(key)
    return problems


def _translated(error: Any, top: Value, where: str) -> Iterator[Problem]:
    value = top.at(*error.absolute_path) or top
    within = _within(where, error.absolute_path)
    if error.validator == "additionalProperties":
        yield from _unknown(value, error, within)
    elif error.validator == "required":
        yield from _missing(value, error, within)
    elif error.validator in ("type", "anyOf") and not _is_scalar_error(error, value):
        yield _wrong_kind(value, error, within)
    elif error.validator in ("minItems", "maxItems"):
        yield _wrong_count(value, error, within)
    elif isinstance(value.data, dict | list):
        yield Problem("E-TYPE", value.spot, f"{within}: {error.message}", "")


def _within(where: str, path: Any) -> str:
    """The section at `path` in words: its dotted path, or `where` for the whole."""
    names = [str(step) for step in path if not isinstance(step, int)]
    if where.startswith("the "):
        return ".".join(names) if names else where
    return ".".join([where, *names])


def _unknown(value: Value, error: Any, within: str) -> Iterator[Problem]:
    known = list(error.schema.get("properties", {}))
    absent = [name for name in error.schema.get("required", []) if name not in value.entries]
    for name, entry in value.entries.items():
        if name in known:
            continue
        near = closest_match(name, known)
        place = entry.key or entry.spot
        if near is not None:
            also = ", which must be given" if near in absent else ""
            cause = f"unknown key '{name}' in {within}"
            yield Problem("E-KEY-UNKNOWN", place, cause, f"did you mean '{near}'{also}?")
        else:
            keys = f"it may hold {join_words(known, 'and')}" if known else "it holds no keys"
            yield Problem("E-KEY-UNKNOWN", place, f"unknown key '{name}' in {within}", keys)


def _missing(value: Value, error: Any, within: str) -> Iterator[Problem]:
    known = error.schema.get("properties", {})
    absent = [name for name in error.schema["required"] if name not in value.entries]
    strange = [name for name in value.entries if name not in known]
    free = [name for name in known if name not in value.entries]
    joined = {closest_match(name, free) for name in strange}
    missing = error.message.split("'")[1]
    if missing not in absent or missing in joined:
        return
    description = known.get(missing, {}).get("description", "")
    fix = f"add `{missing}:`" + (
        f" - {description[:1].lower()}{description[1:]}" if description else ""
    )
    yield Problem("E-KEY-MISSING", value.spot, f"{within} has no '{missing}'", fix)


def _is_scalar_error(error: Any, value: Value) -> bool:
    """True when a scalar stands where a scalar may stand: the typed reader has the words."""
    return not isinstance(value.data, dict | list) and not _wants_collection(error.schema)


def _wants_collection(schema: Any) -> bool:
    options = schema.get("anyOf", [schema])
    return any(option.get("type") in ("object", "array") or "$ref" in option for option in options)


INPUT = re.compile(r"blocks\.[^.]+\.in\.")
TWO_WIRES = "an input takes one wire; the block command_mux lets one of two through"


def _wrong_kind(value: Value, error: Any, within: str) -> Problem:
    wanted = error.schema.get("type", "")
    if value.data is None and not value.text:
        return Problem("E-VALUE-EMPTY", value.spot, f"{within} is empty", _how(wanted))
    is_what = (
        "a mapping"
        if isinstance(value.data, dict)
        else "a list"
        if isinstance(value.data, list)
        else f"'{value.text}'"
    )
    words = {"object": "keys with values are", "array": "a list is"}.get(wanted, "one value is")
    cause = f"{within} is {is_what}, but {words} wanted"
    fix = TWO_WIRES if isinstance(value.data, list) and INPUT.match(within) else _how(wanted)
    return Problem("E-TYPE", value.spot, cause, fix)


def _how(wanted: str) -> str:
    return {
        "object": "write `{key: value}`, or indented `key: value` lines below it",
        "array": "write `[a, b]`, or lines that begin with a dash below it",
    }.get(wanted, "write a number or a word")


def _wrong_count(value: Value, error: Any, within: str) -> Problem:
    count, wanted = len(value.items), error.validator_value
    cause = f"{within} has {count} entr{'y' if count == 1 else 'ies'}, but {wanted} are wanted"
    fix = f"write {wanted} values between the brackets"
    if count > wanted and any(item.text.endswith(tuple("0123456789")) for item in value.items):
        fix += "; a comma separates them, so a decimal is written with a point: 1.5 m"
    return Problem("E-TYPE", value.spot, cause, fix)
