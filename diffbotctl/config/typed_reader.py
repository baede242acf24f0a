"""Values of a file to typed Sections: quantities become SI numbers, sections become objects.

A value that cannot be read is noted as a problem and stands as None in the object, so that the
rest can still be checked; such an object never leaves the configuration.
"""

from __future__ import annotations

import re
from typing import Any, TypeVar, get_args, get_origin

from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Problem, closest_match, join_words
from diffbotctl.params import Declaration, Pin, Section, declared
from diffbotctl.units import KINDS, UnitError, example, quantity

S = TypeVar("S", bound=Section)

PIN = re.compile(r"(A?[0-9]{1,3})\Z")
TRUE_WORDS = {"yes": "true", "on": "true", "y": "true", "no": "false", "off": "false", "n": "false"}


class Reader:
    """Reads values by their declarations, collecting the problems."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []

    def section(self, value: Value, kind: type[S]) -> S:
        """The mapping `value` as an object of `kind`; what is absent has its default."""
        found: dict[str, Any] = {}
        for name, declaration in declared(kind).items():
            entry = value.entries.get(declaration.key)
            if entry is not None:
                found[name] = self.value(entry, declaration.kind, declaration)
            elif declaration.is_required:
                found[name] = None
        return kind(**found)

    def value(self, value: Value, kind: Any, declaration: Declaration) -> Any:
        """`value` as a `kind`, within the bounds of `declaration`."""
        if kind is object or kind is dict:
            return value.plain()
        if declaration.none and value.text in ("none", "null") and not value.quoted:
            return None
        if isinstance(kind, type) and issubclass(kind, Section):
            return self.section(value, kind) if isinstance(value.data, dict) else None
        if get_origin(kind) is list:
            return [self.value(item, get_args(kind)[0], declaration) for item in value.items]
        if get_origin(kind) is dict:
            return {
                name: self.value(item, get_args(kind)[1], declaration)
                for name, item in value.entries.items()
            }
        if get_origin(kind) is tuple:
            return tuple(
                self.value(item, each, declaration)
                for item, each in zip(value.items, get_args(kind), strict=False)
            )
        return self.leaf(value, kind, declaration)

    def leaf(self, value: Value, kind: Any, declaration: Declaration) -> Any:
        """A scalar, or None with a problem noted."""
        data, problem = read_scalar(value, kind, declaration)
        if problem is not None:
            self.problems.append(problem)
        return data


def read_scalar(value: Value, kind: Any, declaration: Declaration) -> tuple[Any, Problem | None]:
    """The scalar `value` in SI as a `kind`, and what is wrong with it, if anything is."""
    if isinstance(value.data, dict | list):
        return None, None  # the shape says so
    if value.data is None:
        return None, _empty(value, declaration)
    try:
        data = READERS[kind](value, declaration)
    except UnitError as error:
        fix = f"{declaration.key}: {declaration.help}"
        return None, Problem("E-UNIT", value.spot, str(error), fix)
    except _WrongError as wrong:
        return None, Problem("E-TYPE", value.spot, wrong.cause, wrong.fix)
    complaint = declaration.complaint(data)
    if complaint is None:
        return data, None
    if declaration.choices:
        return None, _not_a_choice(value, declaration)
    written = f"{value.text or data}"
    cause = f"{declaration.key} is {written}; it {complaint}"
    return None, Problem("E-BOUNDS", value.spot, cause, f"{declaration.key}: {declaration.help}")


class _WrongError(Exception):
    def __init__(self, cause: str, fix: str) -> None:
        super().__init__(cause)
        self.cause = cause
        self.fix = fix


def _float(value: Value, declaration: Declaration) -> float:
    data = value.data
    if isinstance(data, bool):
        raise _WrongError(f"{value.text} is not {_wanted(declaration)}", _write(declaration))
    if isinstance(data, int | float):
        return float(data)
    if declaration.unit in ("",):
        raise _WrongError(_no_number(value, declaration), _write(declaration))
    return quantity(str(data), declaration.unit)


def _int(value: Value, declaration: Declaration) -> int:
    data = value.data
    if isinstance(data, int) and not isinstance(data, bool):
        return data
    if isinstance(data, float) and data.is_integer():
        return int(data)
    fix = f"{declaration.key}: {declaration.help}"
    raise _WrongError(f"'{value.text}' is not a whole number", fix)


def _bool(value: Value, declaration: Declaration) -> bool:
    if isinstance(value.data, bool):
        return value.data
    word = TRUE_WORDS.get(value.text.lower())
    fix = f"write {word}" if word else "write true or false"
    raise _WrongError(f"'{value.text}' is not true or false", fix)


def _str(value: Value, declaration: Declaration) -> str:
    if isinstance(value.data, str):
        return value.data
    what = "true or false" if isinstance(value.data, bool) else "a number"
    if declaration.choices:
        return value.text
    cause = f"{value.text} is {what}, but {declaration.key} wants a text"
    raise _WrongError(cause, f"put it in quotes: '{value.text}'")


def _pin(value: Value, declaration: Declaration) -> Pin:
    data = value.data
    name = str(data) if isinstance(data, int | str) and not isinstance(data, bool) else ""
    if not PIN.match(name):
        cause = f"'{value.text}' is not the name of a pin"
        raise _WrongError(cause, "write the number or name printed on the board, such as 5 or A0")
    return Pin(name)


READERS: dict[Any, Any] = {float: _float, int: _int, bool: _bool, str: _str, Pin: _pin}


def _empty(value: Value, declaration: Declaration) -> Problem:
    sample = _sample(declaration) or (declaration.choices[0] if declaration.choices else "")
    such_as = f", such as {sample}" if sample else ""
    fix = f"write a value behind the colon{such_as}, or remove the key"
    return Problem("E-VALUE-EMPTY", value.spot, f"{declaration.key} has no value", fix)


def _not_a_choice(value: Value, declaration: Declaration) -> Problem:
    choices = [str(choice) for choice in declaration.choices]
    near = closest_match(value.text, choices)
    fix = f"did you mean {near}?" if near else f"use {join_words(choices)}"
    if len(choices) == 1:
        cause = f"{declaration.key} cannot be '{value.text}'; only {choices[0]} is known"
    else:
        cause = f"{declaration.key} cannot be '{value.text}'; it is one of {join_words(choices)}"
    return Problem("E-CHOICE", value.spot, cause, fix)


def _no_number(value: Value, declaration: Declaration) -> str:
    if re.match(r"[0-9]+:[0-9]", value.text):
        return f"'{value.text}' is a text; a number has no colon"
    return f"'{value.text}' is not a number"


def _wanted(declaration: Declaration) -> str:
    return KINDS.get(declaration.unit, "a number")


def _sample(declaration: Declaration) -> str:
    return example(declaration.unit) if declaration.unit else ""


def _write(declaration: Declaration) -> str:
    sample = _sample(declaration)
    such_as = f" (such as {sample})" if sample else ""
    return f"{declaration.key}{such_as}: {declaration.help}"
