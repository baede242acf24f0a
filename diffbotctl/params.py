"""Declarations of settings: each stands once, with type, unit, bounds, default and a sentence.

A block's parameter, a part of a robot file and an option of a pipeline are all declared with
`Param`. From it come the JSON Schema, the reference page, the checks and the error texts.
"""

from __future__ import annotations

import operator
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar, cast, get_args

T = TypeVar("T")


class Required:
    """Stands for the default of a setting that must be given."""

    def __repr__(self) -> str:
        return "required"


REQUIRED = Required()


@dataclass(frozen=True, kw_only=True, eq=False)
class Declaration:
    """One declared setting. Class attribute of the Section or Block that it belongs to.

    `bounds` maps a key of BOUNDS to its limit in SI units; the other fields are as in `Param`.
    """

    kind: type
    default: Any
    unit: str
    help: str
    bounds: dict[str, float]
    choices: tuple[Any, ...]
    live: bool
    none: bool
    key: str
    reason: str
    shared: bool
    name: str = ""

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "key", self.key or name)

    @property
    def is_required(self) -> bool:
        """True when there is no default: the value must be given."""
        return isinstance(self.default, Required)

    def bound_phrases(self) -> list[str]:
        """The bounds in words, such as `at least 0.1 s`."""
        return [self._phrase(bound, limit) for bound, limit in self.bounds.items()]

    def complaint(self, value: Any) -> str | None:
        """What is wrong with an SI `value`, in words, or None when it is fine."""
        if value is None:
            return None if self.none else "must be given"
        if self.choices and value not in self.choices:
            return f"must be one of {', '.join(map(str, self.choices))}"
        for bound, limit in self.bounds.items():
            if not BOUNDS[bound].holds(value, limit):
                because = f": {self.reason}" if self.reason else ""
                return f"must be {self._phrase(bound, limit)}{because}"
        return None

    def _phrase(self, bound: str, limit: float) -> str:
        return f"{BOUNDS[bound].phrase} {with_unit(limit, self.unit)}"


class Bound(NamedTuple):
    """A kind of bound: its test `holds(value, limit)`, its words, its keyword in JSON Schema."""

    holds: Callable[[Any, float], bool]
    phrase: str
    keyword: str


BOUNDS = {
    "above": Bound(operator.gt, "above", "exclusiveMinimum"),
    "below": Bound(operator.lt, "below", "exclusiveMaximum"),
    "minimum": Bound(operator.ge, "at least", "minimum"),
    "maximum": Bound(operator.le, "at most", "maximum"),
}


def Param(  # noqa: N802 - reads as a declaration
    kind: type[T],
    *,
    help: str,
    default: Any = REQUIRED,
    unit: str = "",
    above: float | None = None,
    below: float | None = None,
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[Any, ...] = (),
    live: bool = False,
    none: bool = False,
    key: str = "",
    reason: str = "",
    shared: bool = False,
    least: float | None = None,
    most: float | None = None,
) -> T:
    """Declare a setting of type `kind`: float, int, bool, str, Pin, a Section, or a list[...],
    dict[str, ...] or tuple[...] of them (a tuple is a list of fixed length in the file).

    `unit` is SI ("" for a plain number or text; "1" for a ratio that may be given in %).
    `above/below` exclude their limit, `minimum/maximum` include it. `live`: may change while
    running. `none`: the word `none` is allowed. A setting without default must be given. `key` is
    the word in the file where it cannot be a name in Python (`in`, `with`, `from`). `reason` says
    in words why the bounds are what they are. `shared`: a Section of which any part may be left
    out, because it holds what is common to the sections beside it. `least/most` are the former
    names of `minimum/maximum`; they warn with DeprecationWarning and go in the next release.
    """
    if least is not None or most is not None:
        text = "Param(least=, most=) are now called minimum= and maximum="
        warnings.warn(text, DeprecationWarning, stacklevel=2)
    limits = {
        "above": above,
        "below": below,
        "minimum": least if minimum is None else minimum,
        "maximum": most if maximum is None else maximum,
    }
    declaration = Declaration(
        kind=kind,
        default=default,
        unit=unit,
        help=help,
        bounds={bound: limit for bound, limit in limits.items() if limit is not None},
        choices=choices,
        live=live,
        none=none,
        key=key,
        reason=reason,
        shared=shared,
    )
    return cast(T, declaration)


def Choice(  # noqa: N802 - reads as a declaration
    options: Any, *, help: str, default: Any = REQUIRED, none: bool = False, live: bool = False
) -> Any:
    """Declare a setting that is one of the words of the Literal type `options`.

    Annotate the attribute with the same type, so that mypy finds a misspelt word wherever it is
    compared: `idle: IdleMode = Choice(IdleMode, default="coast", help="...")`.
    """
    choices = get_args(options)
    kind = type(choices[0])
    return Param(kind, choices=choices, default=default, none=none, live=live, help=help)


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
    return members(owner, Declaration)


def members(owner: type, *kinds: type[T]) -> dict[str, T]:
    """Class attributes of these types by name, inherited ones first, in the order they stand."""
    return {
        name: value
        for base in reversed(owner.__mro__)
        for name, value in vars(base).items()
        if isinstance(value, kinds)
    }


def with_unit(value: float, unit: str) -> str:
    """A number as a person reads it: `0.3 m/s`, `5`."""
    text = f"{value:g}"
    return text if unit in ("", "1") else f"{text} {unit}"
