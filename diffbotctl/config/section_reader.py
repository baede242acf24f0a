"""Reads a tree of values into typed Sections by their declarations, in one pass.

Quantities become SI numbers, mappings become objects. A wrong shape (a key that is not declared,
one that is missing, a list in place of a number) and a wrong value are both noted as problems; the
value is None then, so that the rest can still be checked. Such an object never leaves the
configuration.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from typing import Any, TypeVar, get_args, get_origin

from diffbotctl.config.motor_drivers import unknown_driver
from diffbotctl.config.unsupported_parts import UnsupportedPart, unsupported_part
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Problem, closest_match, join_words
from diffbotctl.params import Declaration, Pin, Section, Spread, declared
from diffbotctl.units import KINDS, UnitError, example, plain_number, quantity

S = TypeVar("S", bound=Section)
Path = tuple[str, ...]

PIN = re.compile(r"A?[0-9]{1,3}\Z")
PRINTED_PIN = re.compile(r"(A|D|GP|GPIO|IO)[ _-]?([0-9]{1,3})\Z", re.IGNORECASE)
BOOLEAN_WORDS = {
    "yes": "true",
    "on": "true",
    "y": "true",
    "no": "false",
    "off": "false",
    "n": "false",
}
BLOCK_INPUT = re.compile(r"blocks\.[^.]+\.in\.")
SECTIONS_SHOWN_MAX = 3
TWO_WIRES = "an input takes one wire; use the block command_mux to select one of two"
# Kind of value -> how a message names it, and how it is written.
MAPPING = ("a mapping", "write `{key: value}`, or indented `key: value` lines below it")
LIST = ("a list", "write `[a, b]`, or lines with a leading dash below it")
SCALAR = ("a single value", "write a number or a word")


def read_section(tree: Value, kind: type[S], title: str, problems: list[Problem]) -> S:
    """The mapping `tree` as an object of `kind`, called `title` in messages.

    What is absent has its default, or None where it is required.
    """
    reader = _Reader(title, (), problems)
    owner: Any = kind  # a class of type S is hashable, which mypy does not see
    reader.places = _places(owner)
    return reader.section(tree, kind, ())


def read_parameters(
    tree: Value, block: type, title: str, problems: list[Problem]
) -> dict[str, Any]:
    """The values of all parameters of the class `block` by attribute, from its mapping `with`."""
    return _Reader("", (title,), problems).entries(tree, block, (), is_whole=True)


def read_setting(value: Value, declaration: Declaration, problems: list[Problem]) -> Any:
    """The value of one setting as its declaration states it; None when it is not one."""
    return _Reader("", (), problems).value(value, declaration.kind, declaration, (declaration.key,))


@cache
def _places(kind: Any) -> dict[str, list[str]]:
    """Dotted paths of the single values and sections in a file of `kind`, by their last key."""
    places: dict[str, list[str]] = {}

    def add(owner: type, path: Path) -> None:
        for declaration in declared(owner).values():
            inner = (*path, declaration.key)
            places.setdefault(declaration.key, []).append(".".join(inner))
            if isinstance(declaration.kind, type) and issubclass(declaration.kind, Section):
                add(declaration.kind, inner)

    add(kind, ())
    return places


class _Reader:
    """Reads one tree; `title` names the whole, `prefix` begins every dotted path in a message."""

    def __init__(self, title: str, prefix: Path, problems: list[Problem]) -> None:
        self.title = title
        self.prefix = prefix
        self.problems = problems
        self.places: dict[str, list[str]] = {}  # key -> where the file has it

    def section(self, value: Value, kind: type[S], path: Path, is_whole: bool = True) -> S:
        return kind(**self.entries(value, kind, path, is_whole))

    def entries(self, value: Value, owner: type, path: Path, is_whole: bool) -> dict[str, Any]:
        """The values of everything that `owner` declares; `is_whole`: required keys must be there.

        What is absent has its default, or None where it is required.
        """
        declarations = declared(owner)
        by_key = {declaration.key: declaration for declaration in declarations.values()}
        self._check_unknown(value, by_key, path, is_whole)
        values: dict[str, Any] = {}
        for name, declaration in declarations.items():
            entry = value.entries.get(declaration.key)
            if entry is not None:
                inner = (*path, declaration.key)
                values[name] = self.value(entry, declaration.kind, declaration, inner)
            else:
                values[name] = None if declaration.is_required else declaration.default
        if is_whole:
            self._check_missing(value, by_key, path)
        return values

    def value(self, value: Value, kind: Any, declaration: Declaration, path: Path) -> Any:
        """`value` as a `kind`, within the bounds of `declaration`; None when it is not one."""
        if kind is object:
            return value.plain()
        if declaration.none and value.text in ("none", "null") and not value.quoted:
            return None
        origin = get_origin(kind) or kind
        if kind is Spread:
            return self._spread(value, declaration, path)
        if origin in (list, tuple):
            return self._items(value, kind, declaration, path)
        if origin is dict or issubclass(origin, Section):
            return self._mapping(value, kind, declaration, path)
        if isinstance(value.data, dict | list):
            self._wrong_kind(value, SCALAR, path)
            return None
        data, problem = read_scalar(value, kind, declaration)
        if problem is not None:
            self.problems.append(_about_part(problem, value, declaration, path))
        return data

    def _items(self, value: Value, kind: Any, declaration: Declaration, path: Path) -> Any:
        if not self._has_kind(value, list, declaration, path):
            return None if value.data is None and declaration.none else []
        kinds = get_args(kind)
        if get_origin(kind) is list:
            return [self.value(item, kinds[0], declaration, path) for item in value.items]
        self._check_count(value, len(kinds), path)
        return tuple(
            self.value(item, item_kind, declaration, path)
            for item, item_kind in zip(value.items, kinds, strict=False)
        )

    def _spread(self, value: Value, declaration: Declaration, path: Path) -> Spread | None:
        """One value, or a list of two in order."""
        if not isinstance(value.data, list):
            one = self.value(value, float, declaration, path)
            return None if one is None else Spread(one, one)
        ends = self._items(value, tuple[float, float], declaration, path)
        if len(ends) != 2 or None in ends:
            return None
        if ends[0] > ends[1]:
            first, second = (item.text for item in value.items)
            cause = f"the range {path[-1]} begins at {first} and ends at {second}"
            self.problems.append(
                Problem("E-RANGE", value.place, cause, f"write [{second}, {first}]")
            )
            return None
        return Spread(*ends)

    def _mapping(self, value: Value, kind: Any, declaration: Declaration, path: Path) -> Any:
        is_mapping = self._has_kind(value, dict, declaration, path)
        if kind is dict:
            return value.plain() if is_mapping else {}
        if get_origin(kind) is dict:
            entry_kind = get_args(kind)[1]
            return {
                name: self.value(entry, entry_kind, declaration, (*path, name))
                for name, entry in value.entries.items()
            }
        is_whole = declaration.is_required or not declaration.shared
        return self.section(value, kind, path, is_whole) if is_mapping else None

    def _has_kind(self, value: Value, kind: type, declaration: Declaration, path: Path) -> bool:
        """True for a mapping or list as expected; reports anything else."""
        if isinstance(value.data, kind):
            return True
        if not (declaration.none and value.data is None):
            self._wrong_kind(value, MAPPING if kind is dict else LIST, path)
        return False

    def _within(self, path: Path) -> str:
        return ".".join([*self.prefix, *path]) or self.title

    def _check_unknown(
        self, value: Value, declarations: dict[str, Declaration], path: Path, is_whole: bool
    ) -> None:
        for name, entry in value.entries.items():
            if name in declarations:
                continue
            near = closest_match(name, declarations)
            if near is None or name in self.places:
                names = join_words(declarations, "and")
                fix = f"allowed keys are {names}" if declarations else "no keys are allowed here"
                fix = self._right_section(name, path) or fix
            else:
                is_missing = is_whole and declarations[near].is_required
                required = "the required key " if is_missing and near not in value.entries else ""
                fix = f"did you mean {required}'{near}'?"
            cause = f"unknown key '{name}' in {self._within(path)}"
            place = entry.name_place
            self.problems.append(Problem("E-KEY-UNKNOWN", place, cause, fix))

    def _right_section(self, name: str, path: Path) -> str:
        """The fix for a key of another section of the file; those below this one come first."""
        here = ".".join((*path, ""))
        places = sorted(self.places.get(name, ()), key=lambda place: not place.startswith(here))
        if places and places[0].startswith(here) and here:
            places = places[:1]
        if places and "." not in places[0]:
            return f"`{name}:` is a section of the file itself, not of another one"
        return f"its place is {join_words(places[:SECTIONS_SHOWN_MAX])}" if places else ""

    def _check_missing(
        self, value: Value, declarations: dict[str, Declaration], path: Path
    ) -> None:
        free = [name for name in declarations if name not in value.entries]
        # A misspelt key is reported as unknown, not also as missing.
        misspelt = {closest_match(name, free) for name in value.entries if name not in declarations}
        for name in free:
            declaration = declarations[name]
            if not declaration.is_required or name in misspelt:
                continue
            help = declaration.help
            fix = f"add `{name}:` - {help[:1].lower()}{help[1:]}"
            cause = f"{self._within(path)} has no '{name}'"
            self.problems.append(Problem("E-KEY-MISSING", value.place, cause, fix))

    def _wrong_kind(self, value: Value, expected: tuple[str, str], path: Path) -> None:
        within = self._within(path)
        words, fix = expected
        if value.data is None and not value.text:
            problem = Problem("E-VALUE-EMPTY", value.place, f"{within} is empty", fix)
            self.problems.append(problem)
            return
        if isinstance(value.data, dict):
            written = "a mapping"
        else:
            written = "a list" if isinstance(value.data, list) else f"'{value.text}'"
        cause = f"{within} is {written}, but {words} is required"
        if isinstance(value.data, list) and BLOCK_INPUT.match(within):
            fix = TWO_WIRES
        self.problems.append(Problem("E-TYPE", value.place, cause, fix))

    def _check_count(self, value: Value, expected: int, path: Path) -> None:
        count = len(value.items)
        if count == expected:
            return
        entries = "entry" if count == 1 else "entries"
        cause = f"{self._within(path)} has {count} {entries}, but {expected} are required"
        fix = f"write {expected} values between the brackets"
        if count > expected and any(item.text[-1:].isdecimal() for item in value.items):
            fix += "; commas separate values, so write decimals with a point: 1.5 m"
        self.problems.append(Problem("E-TYPE", value.place, cause, fix))


def read_scalar(value: Value, kind: Any, declaration: Declaration) -> tuple[Any, Problem | None]:
    """The scalar `value` in SI as a `kind`, and what is wrong with it, if anything is."""
    help = f"{declaration.key}: {declaration.help}"
    if value.data is None:
        sample = _sample(declaration) or (declaration.choices[0] if declaration.choices else "")
        such_as = f", such as {sample}" if sample else ""
        fix = f"write a value after the colon{such_as}, or remove the key"
        return None, Problem("E-VALUE-EMPTY", value.place, f"{declaration.key} has no value", fix)
    try:
        data = SCALAR_READERS[kind](value, declaration)
    except UnitError as error:
        return None, Problem("E-UNIT", value.place, str(error), help)
    except _ScalarTypeError as error:
        fix = f"write {value.text} without quotes" if _is_quoted(value, kind) else error.fix
        return None, Problem("E-TYPE", value.place, str(error), fix or help)
    complaint = declaration.complaint(data)
    if complaint is None:
        return data, None
    if declaration.choices:
        return None, _not_a_choice(value, declaration)
    cause = f"{declaration.key} is {value.text or data}; it {complaint}"
    smaller = declaration.thousandth(value.text, data)
    if smaller:
        cause = f"{declaration.key} is {value.text} {declaration.unit}; it {complaint}"
        help = f"did you mean {smaller}? {help}"
    return None, Problem("E-BOUNDS", value.place, cause, help)


def _is_quoted(value: Value, kind: Any) -> bool:
    """True for a number, true or false in quotes, which make it text."""
    words = {int: r"[-+]?[0-9]+\Z", bool: r"(?:true|false)\Z"}
    return value.quoted and kind in words and re.match(words[kind], value.text) is not None


class _ScalarTypeError(Exception):
    """A scalar is not of the declared kind. Without a `fix` the setting's help is shown."""

    def __init__(self, cause: str, fix: str = "") -> None:
        super().__init__(cause)
        self.fix = fix


def _float(value: Value, declaration: Declaration) -> float:
    data, unit = value.data, declaration.unit
    if isinstance(data, int | float) and not isinstance(data, bool):
        return plain_number(float(data), unit, value.text)
    if unit and not isinstance(data, bool):
        return quantity(str(data), unit)
    if isinstance(data, bool):
        cause = f"{value.text} is not {KINDS.get(unit, 'a number')}"
    elif re.match(r"[0-9]+:[0-9]", value.text):
        cause = f"'{value.text}' is text; a number has no colon"
    else:
        cause = f"'{value.text}' is not a number"
    sample = _sample(declaration)
    such_as = f" (such as {sample})" if sample else ""
    raise _ScalarTypeError(cause, f"{declaration.key}{such_as}: {declaration.help}")


def _int(value: Value, declaration: Declaration) -> int:
    data = value.data
    if isinstance(data, int | float) and not isinstance(data, bool) and data == int(data):
        return int(data)
    raise _ScalarTypeError(f"'{value.text}' is not a whole number")


def _bool(value: Value, declaration: Declaration) -> bool:
    if isinstance(value.data, bool):
        return value.data
    word = BOOLEAN_WORDS.get(value.text.lower(), "true or false")
    raise _ScalarTypeError(f"'{value.text}' is not true or false", f"write {word}")


def _str(value: Value, declaration: Declaration) -> str:
    if isinstance(value.data, str):
        return value.data
    if declaration.choices:
        return value.text
    kind = "a boolean" if isinstance(value.data, bool) else "a number"
    cause = f"{value.text} is {kind}, but {declaration.key} requires text"
    raise _ScalarTypeError(cause, f"put it in quotes: '{value.text}'")


def _pin(value: Value, declaration: Declaration) -> Pin:
    data = value.data
    name = str(data) if isinstance(data, int | str) and not isinstance(data, bool) else ""
    if not PIN.match(name):
        raise _ScalarTypeError(f"'{value.text}' is not a pin name", _pin_fix(value, declaration))
    return Pin(name)


def _pin_fix(value: Value, declaration: Declaration) -> str:
    """What to write instead: boards have `D2` or `GP2` printed on them, too."""
    if value.data is False and declaration.none:
        return "write none where nothing is connected"
    printed = PRINTED_PIN.match(value.text)
    if printed is None:
        return "write the number or name printed on the board, such as 5 or A0"
    return f"write {'A' if printed[1].upper() == 'A' else ''}{int(printed[2])}"


CHOICES_TWICE_MAX = 20  # values that both the cause and the fix name

SCALAR_READERS: dict[Any, Any] = {float: _float, int: _int, bool: _bool, str: _str, Pin: _pin}


def _not_a_choice(value: Value, declaration: Declaration) -> Problem:
    choices = [str(choice) for choice in declaration.choices]
    hexadecimal = _hexadecimal(value.text) if declaration.kind is int else ""
    near = closest_match(value.text, choices) or closest_match(value.text.lower(), choices)
    near = near or contained_choice(value.text, choices)
    if hexadecimal in choices:
        fix = f"write {hexadecimal}, the decimal number of 0x{value.text}"
    else:
        fix = f"did you mean {near}?" if near else f"use {join_words(choices)}"
    allowed = (
        f"the only allowed value is {choices[0]}"
        if len(choices) == 1
        else f"allowed values are {join_words(choices)}"
    )
    if len(choices) > CHOICES_TWICE_MAX:
        allowed = f"it is none of the {len(choices)} allowed values"
    cause = f"{declaration.key} cannot be '{value.text}'; {allowed}"
    return Problem("E-CHOICE", value.place, cause, fix)


def contained_choice(text: str, choices: Iterable[str]) -> str | None:
    """The longest of `choices` in a name such as Arduino Mega 2560; None if there is none."""
    joined = re.sub("[^a-z0-9]", "", text.lower())
    contained = [choice for choice in choices if len(choice) > 2 and choice in joined]
    return max(contained, key=len, default=None)


def _hexadecimal(text: str) -> str:
    """The decimal number of `text`, such as an address copied without its 0x; empty for none."""
    return str(int(text, 16)) if re.fullmatch("[0-9A-Fa-f]{1,8}", text) else ""


def _about_part(problem: Problem, value: Value, declaration: Declaration, path: Path) -> Problem:
    """`problem`; of a known part that is not supported, with what comes nearest."""
    if problem.code != "E-CHOICE":
        return problem
    field = "sensors.type" if path[0] == "sensors" else ".".join(path[-2:])
    part = refused_part(field, value.text, map(str, declaration.choices))
    if part is None:
        return problem
    return Problem(problem.code, problem.place, part.cause, part.fix)


def refused_part(field: str, written: str, names: Iterable[str]) -> UnsupportedPart | None:
    """What to write in place of a part that is none of `names`, as far as it is known.

    `field`: the end of its path in the robot file, such as `imu.type`.
    """
    if field == "motor.driver":
        return unknown_driver(written)
    return unsupported_part(field, written, names)


def _sample(declaration: Declaration) -> str:
    return example(declaration.unit) if declaration.unit else ""
