"""Checks what a block returns: the class of each message, and the type of each of its fields.

Numbers of other classes, such as those of numpy, become plain ones: the blocks that take them, and
the files that they are written to, expect these.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import redirect_stdout
from functools import cache
from math import inf, isfinite
from numbers import Integral, Real
from operator import is_
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from diffbotctl.block import Block, Out, outputs
from diffbotctl.log import LogFile
from diffbotctl.message_types import type_name
from diffbotctl.messages import FINITE, Field, fields

CHECKED_REACTIONS = 20  # of the blocks of this package; those of others are always checked
OWN_PACKAGE = "diffbotctl."
PLAIN = frozenset({float, int, bool, str, NoneType})

Reaction = Callable[..., Any]


class OutputError(Exception):
    """A block has returned what does not fit its outputs; the text names the field."""


def check_output(block: Block, output: Any) -> Any:
    """Check what `react` of `block` has returned; the same with plain numbers.

    Raises OutputError.
    """
    if output is None:
        return None
    kind: type = type(block)
    ports = _outputs(kind)
    if not ports:
        raise OutputError(f"it returned {_describe(output)}, but it has no output")
    messages = (output,)
    if len(ports) > 1:
        if type(output) is not tuple or len(output) != len(ports):
            raise OutputError(
                f"it returned {_describe(output)} instead of None or a tuple of {len(ports)}, one "
                f"for each output: {', '.join(ports)}"
            )
        messages = output
    checked_messages = tuple(
        None if message is None else check_message(port, out.kind, message)
        for (port, out), message in zip(ports.items(), messages, strict=True)
    )
    return checked_messages if len(ports) > 1 else checked_messages[0]


def check_message(port: str, kind: type, message: Any) -> Any:
    """Check a message for the output `port`; the same with plain numbers. Raises OutputError."""
    plain: dict[str, Any] = {}
    if not isinstance(message, kind):
        raise OutputError(f"output {port}: {_describe(message)} instead of a {_signature(kind)}")
    for name, (hint, field) in _fields(kind).items():
        value = getattr(message, name)
        if type(value) is not hint and not _fits(value, hint):
            raise OutputError(f"output {port}: {name} is {_describe(value)}, not {_name(hint)}")
        if kind in FINITE and not _is_finite(value):
            raise OutputError(f"output {port}: {name} is {value}, not a finite number")
        if not _is_within(value, field):
            limits = f"{field.minimum:g} to {field.maximum:g} {field.unit}".rstrip()
            raise OutputError(f"output {port}: {name} is {value}, not {limits}")
        if (plain_value := _plain(port, value)) is not value:
            plain[name] = plain_value
    if not plain:
        return message
    values = [plain.get(name, getattr(message, name)) for name in _fields(kind)]
    return type(message)(*values)


def _signature(kind: type) -> str:
    return f"{type_name(kind)}({', '.join(_fields(kind))})"


def _plain(port: str, value: Any) -> Any:
    """`value` with plain numbers; it is returned itself if it has no others.

    Raises OutputError for a message in it that does not fit.
    """
    if type(value) in PLAIN:
        return value
    if hasattr(value, "_fields"):
        return check_message(port, type(value), value)
    if isinstance(value, tuple):
        parts = [_plain(port, part) for part in value]
        return value if all(map(is_, parts, value)) else tuple(parts)
    if isinstance(value, Integral):
        return int(value)
    return float(value) if isinstance(value, Real) else value


@cache
def _outputs(kind: type) -> dict[str, Out]:
    """The outputs of a class of blocks."""
    return outputs(kind)


@cache
def _fields(kind: type) -> dict[str, tuple[Any, Field]]:
    """Type and declaration of each field."""
    return fields(kind)


def _is_within(value: Any, field: Field) -> bool:
    """Whether a number, or each number of a tuple, is within the bounds; `nan` is not."""
    if field.minimum == -inf and field.maximum == inf:
        return True
    if isinstance(value, tuple):
        return all(_is_within(item, field) for item in value)
    return not isinstance(value, Real) or field.minimum <= float(value) <= field.maximum


def _fits(value: Any, hint: Any) -> bool:
    origin = get_origin(hint)
    if origin is Literal:
        return value in get_args(hint)
    if origin in (Union, UnionType):
        return any(_fits(value, part) for part in get_args(hint))
    if origin is tuple:
        return isinstance(value, tuple) and _parts_fit(value, get_args(hint))
    if hint is float:
        return isinstance(value, Real) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, Integral) and not isinstance(value, bool)
    return not isinstance(hint, type) or isinstance(value, hint)


def _parts_fit(value: tuple[Any, ...], hints: tuple[Any, ...]) -> bool:
    if hints[-1] is Ellipsis:
        return all(_fits(part, hints[0]) for part in value)
    return len(value) == len(hints) and all(map(_fits, value, hints))


def _is_finite(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_finite, value))
    return not isinstance(value, Real) or isfinite(value)


def _describe(value: Any) -> str:
    if isinstance(value, str):
        return f"the text {value!r}"
    return "None" if value is None else f"{value!r} ({type(value).__name__})"


def _name(hint: Any) -> str:
    if get_origin(hint) is Literal:
        return f"one of {', '.join(map(repr, get_args(hint)))}"
    names = {float: "a number", int: "an integer", str: "a text", NoneType: "None"}
    return names.get(hint, str(getattr(hint, "__name__", hint)))


def _printing_to(file: LogFile, react: Reaction) -> Reaction:
    redirection = redirect_stdout(file)

    def redirected_react(*arguments: Any) -> Any:
        with redirection:
            return react(*arguments)

    return redirected_react


def checked(
    block: Block, react: Reaction, replace: Callable[[Reaction, Reaction], None]
) -> Reaction:
    """`react` with its output checked: always, or the first times for a block of this package.

    After the last check `replace` is called with this function and `react`. What another block
    prints goes to its log: on the terminal it would delay the engine, and spoil the screen.
    """
    is_own = type(block).__module__.startswith(OWN_PACKAGE)
    remaining = CHECKED_REACTIONS
    if not is_own:
        react = _printing_to(LogFile(block.log), react)

    def checked_react(*arguments: Any) -> Any:
        nonlocal remaining
        output = react(*arguments)
        if output is not None:
            output = check_output(block, output)
            if is_own:
                remaining -= 1
                if not remaining:
                    replace(checked_react, react)
        return output

    return checked_react
