"""Declarations of settings: each stands once, with type, unit, bounds, default and a sentence.

A block's parameter, a part of a robot file and an option of a pipeline are all declared with
`Param`. From it come the JSON Schema, the reference page, the checks and the error texts.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

T = TypeVar("T")


class Required:
    """Stands for the default of a setting that must be given."""

    def __repr__(self) -> str:
        return "required"


REQUIRED = Required()


class Declaration:
    """One declared setting. Class attribute of the Section or Block that it belongs to."""

    name: str

    def __init__(
        self,
        kind: type,
        default: Any,
        unit: str,
        help: str,
        bounds: dict[str, float],
        choices: tuple[Any, ...],
        live: bool,
        none: bool,
        key: str = "",
        reason: str = "",
        shared: bool = False,
    ) -> None:
        self.kind = kind
        self.default = default
        self.unit = unit
        self.help = help
        self.bounds = bounds
        self.choices = choices
        self.live = live
        self.none = none
        self.key = key
        self.reason = reason
        self.shared = shared

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        self.key = self.key or name

    @property
    def is_required(self) -> bool:
        """True when there is no default: the value must be given."""
        return isinstance(self.default, Required)

    def complaint(self, value: Any) -> str | None:
        """What is wrong with an SI `value`, in words, or None when it is fine."""
        if value is None:
            return None if self.none else "must be given"
        if self.choices and value not in self.choices:
            return f"must be one of {', '.join(map(str, self.choices))}"
        for word, limit in self.bounds.items():
            if not BOUNDS[word][0](value, limit):
                because = f": {self.reason}" if self.reason else ""
                return f"must be {BOUNDS[word][1]} {with_unit(limit, self.unit)}{because}"
        return None


BOUNDS: dict[str, tuple[Callable[[Any, float], bool], str, str]] = {
    "above": (lambda value, limit: value > limit, "above", "exclusiveMinimum"),
    "below": (lambda value, limit: value < limit, "below", "exclusiveMaximum"),
    "least": (lambda value, limit: value >= limit, "at least", "minimum"),
    "most": (lambda value, limit: value <= limit, "at most", "maximum"),
}


def Param(  # noqa: N802 - reads as a declaration
    kind: type[T],
    *,
    help: str,
    default: Any = REQUIRED,
    unit: str = "",
    above: float | None = None,
    below: float | None = None,
    least: float | None = None,
    most: float | None = None,
    choices: tuple[Any, ...] = (),
    live: bool = False,
    none: bool = False,
    key: str = "",
    reason: str = "",
    shared: bool = False,
) -> T:
    """Declare a setting of type `kind`: float, int, bool, str, Pin, a Section, or a list[...],
    dict[str, ...] or tuple[...] of them (a tuple is a list of fixed length in the file).

    `unit` is SI ("" for a plain number or text; "1" for a ratio that may be given in %).
    `above/below` exclude their limit, `least/most` include it. `live`: may change while running.
    `none`: the word `none` is allowed. A setting without default must be given. `key` is the word
    in the file where it cannot be a name in Python (`in`, `with`, `from`). `reason` says in words
    why the bounds are what they are. `shared`: a Section of which any part may be left out,
    because it holds what is common to the sections beside it.
    """
    limits = {"above": above, "below": below, "least": least, "most": most}
    bounds = {word: limit for word, limit in limits.items() if limit is not None}
    made = Declaration(kind, default, unit, help, bounds, choices, live, none, key, reason, shared)
    return cast(T, made)


class Pin(str):
    """A pin of the board by the number or name printed beside it: `5`, `A0`."""


def FromRobot(field: str) -> Any:  # noqa: N802 - reads as a declaration
    """Declare that a block needs a field of the robot file, such as `drive.track`.

    Geometry is never typed twice: its type, unit and bounds stand where the robot file declares it.
    """
    return RobotField(field)


class RobotField:
    """A block attribute that is read from the robot file."""

    name: str

    def __init__(self, field: str) -> None:
        self.field = field

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name


class Section:
    """A mapping in a file, declared by its Params; instances hold the checked values."""

    def __init__(self, **values: Any) -> None:
        for name, declaration in declared(type(self)).items():
            value = values.pop(name, declaration.default)
            if isinstance(value, Required):
                raise TypeError(f"{type(self).__name__}.{name} must be given")
            setattr(self, name, value)
        if values:
            raise TypeError(f"{type(self).__name__} has no {', '.join(values)}")

    def __repr__(self) -> str:
        inside = ", ".join(f"{name}={getattr(self, name)!r}" for name in declared(type(self)))
        return f"{type(self).__name__}({inside})"


def declared(owner: type) -> dict[str, Declaration]:
    """The Params of a Section or Block class by name, in the order they stand."""
    found: dict[str, Declaration] = {}
    for kind in reversed(owner.__mro__):
        for name, value in vars(kind).items():
            if isinstance(value, Declaration):
                found[name] = value
    return found


def with_unit(value: float, unit: str) -> str:
    """A number as a person reads it: `0.3 m/s`, `5`."""
    text = f"{value:g}"
    return text if unit in ("", "1") else f"{text} {unit}"
