"""Declarations of settings: type, unit, bounds, default and help, each in one place.

Parameters of blocks, fields of robot files and options of pipelines are all declared with `Param`.
The JSON Schema, the reference page, the checks and the error texts are derived from it.
"""

from __future__ import annotations

import operator
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from math import degrees
from typing import Any, NamedTuple, TypeVar, cast, get_args, overload

from diffbotctl.units import UNITS, magnitude_max

T = TypeVar("T")


class Required:
    """The default of a required setting."""

    def __repr__(self) -> str:
        return "required"


REQUIRED = Required()
THOUSANDTHS = {"kg": "g"}  # SI unit -> unit of a thousandth, where that is no milli-unit


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Declaration:
    """One declared setting: a class attribute of its Section or Block.

    `bounds` maps a key of BOUNDS to its limit in SI units; the other fields are those of `Param`.
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
        """True when there is no default."""
        return isinstance(self.default, Required)

    def bound_phrases(self) -> list[str]:
        """The bounds in words, such as `at least 0.1 s`."""
        return [self._phrase(bound, limit) for bound, limit in self.bounds.items()]

    def complaint(self, value: Any) -> str | None:
        """What is wrong with an SI `value`, or None when it is valid."""
        if value is None:
            return None if self.none else "must be given"
        if self.choices and value not in self.choices:
            return f"must be one of {', '.join(map(str, self.choices))}"
        for bound, limit in self.bounds.items():
            if not BOUNDS[bound].holds(value, limit):
                # A reason explains a limit of what is usual; no one asks why a speed is above 0.
                because = f": {self.reason}" if self.reason and bound != "above" else ""
                return f"must be {self._phrase(bound, limit)}{because}"
        limit = magnitude_max(self.unit)
        if isinstance(value, int | float) and not abs(value) <= limit:
            return f"must not be beyond {with_unit(limit, self.unit)}"
        return None

    def thousandth(self, text: str, value: Any) -> str:
        """`text`, a number without a unit, in mm, ms or the like, if that is within the bounds.

        `value` is the number. Empty when it is not.
        """
        unit = THOUSANDTHS.get(self.unit, f"m{self.unit}") if self.unit else ""
        if not text[-1:].isdecimal() or unit not in UNITS or not isinstance(value, int | float):
            return ""
        return f"{text} {unit}" if self.complaint(value * 1e-3) is None else ""

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
    """Declare a setting of type `kind`: float, Spread, int, bool, str, Pin, a Section, or a
    list[...], dict[str, ...] or tuple[...] of them (a tuple is a list of fixed length in the file).

    `unit`: SI unit; "" for a plain number or text, "1" for a ratio that may be written in %.
    `above`, `below`: exclusive bounds. `minimum`, `maximum`: inclusive bounds.
    `reason`: why the bounds are as they are, for the error text.
    `default`: without one, the setting is required.
    `live`: may change while the block runs.
    `none`: the value `none` is allowed.
    `key`: the key in the file, if it cannot be a Python name (`in`, `with`, `from`).
    `shared`: a Section with the common values of its sibling sections; each of its settings may be
    left out.
    `least`, `most`: former names of `minimum` and `maximum`. They emit DeprecationWarning and will
    be removed in the next release.
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


@overload
def Number(
    unit: str, interval: str, default: float | Required, help: str, reason: str = ...
) -> float: ...
@overload
def Number(
    unit: str, interval: str, default: None, help: str, reason: str = ...
) -> float | None: ...
def Number(  # noqa: N802 - reads as a declaration
    unit: str, interval: str, default: Any, help: str, reason: str = ""
) -> Any:
    """Declare a number with its bounds as an interval, such as `[0, 0.5)` or `(0, inf)`.

    A bracket includes the bound, a parenthesis excludes it; an empty text: any number. The default
    None stands for `none` in the file. `unit`, `reason`: as for `Param`.
    """
    bounds = _bounds(interval, float)
    is_none = default is None
    return Param(
        float, unit=unit, default=default, none=is_none, help=help, reason=reason, **bounds
    )


@overload
def Count(interval: str, default: int | Required, help: str, reason: str = ...) -> int: ...
@overload
def Count(interval: str, default: None, help: str, reason: str = ...) -> int | None: ...
def Count(  # noqa: N802 - reads as a declaration
    interval: str, default: Any, help: str, reason: str = ""
) -> Any:
    """Declare a whole number; the arguments are those of `Number`."""
    bounds = _bounds(interval, int)
    return Param(int, default=default, none=default is None, help=help, reason=reason, **bounds)


def _bounds(interval: str, kind: type[float] | type[int]) -> dict[str, Any]:
    """The bounds of an interval by the names that `Param` gives them."""
    if not interval:
        return {}
    ends = [end.strip() for end in interval[1:-1].split(",")]
    names = (
        "above" if interval[0] == "(" else "minimum",
        "below" if interval[-1] == ")" else "maximum",
    )
    return {
        name: kind(end) for name, end in zip(names, ends, strict=True) if end not in ("-inf", "inf")
    }


def Choice(  # noqa: N802 - reads as a declaration
    options: Any, default: Any = REQUIRED, help: str = "", *, live: bool = False
) -> Any:
    """Declare a setting that is one of the words of the Literal type `options`.

    The default None stands for `none` in the file. Annotate the attribute with the same type, so
    that mypy finds a misspelt word wherever it is compared:
    `idle: IdleMode = Choice(IdleMode, "coast", "At rest: ...")`.
    """
    choices = get_args(options)
    kind, is_none = type(choices[0]), default is None
    return Param(kind, choices=choices, default=default, none=is_none, live=live, help=help)


class Spread(NamedTuple):
    """A quantity that is drawn between two values, written [low, high]; of one value, that one."""

    low: float
    high: float


class Pin(str):
    """A pin of the board, by the number or name printed on the board: `5`, `A0`."""


def FromRobot(field: str) -> Any:  # noqa: N802 - reads as a declaration
    """Declare that a block reads a field of the robot file, such as `drive.track`.

    Type, unit and bounds are those of the field's declaration in the robot file.
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
    """A mapping in a file, declared by its Params. Instances hold the checked values."""

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
    """The Params of a Section or Block class by name, in the order of declaration."""
    return members(owner, Declaration)


def members(owner: type, *kinds: type[T]) -> dict[str, T]:
    """Class attributes of these types by name, inherited ones first, in declared order."""
    return {
        name: value
        for base in reversed(owner.__mro__)
        for name, value in vars(base).items()
        if isinstance(value, kinds)
    }


def with_unit(value: float, unit: str) -> str:
    """A number with its unit, for display: `0.3 m/s`, `5`; an angle in rad or deg, by length."""
    text, angle = f"{value:g}", f"{degrees(value):g}"
    if unit == "rad" and len(angle) <= len(text):
        return f"{angle} deg"
    return text if unit in ("", "1") else f"{text} {unit}"
