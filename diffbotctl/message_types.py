"""Message classes: their identity, and which classes can be sent along wires and recorded.

The identity of a message class is its package and its name, `my_package/Face`; the classes of
`diffbotctl.messages` have their name alone. A class can be recorded when it is a NamedTuple whose
first field is `time: int`, and whose other fields are numbers, texts, truth values, choices
(Literal), other such NamedTuples without a time of their own, and tuples of all these.
"""

from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from diffbotctl.messages import BUILT_IN, fields

NESTING_MAX = 4  # of tuples and NamedTuples within a field
FIELDS_MAX = 200  # of one NamedTuple
INTEGER_LIMIT = 1 << 63  # of a whole number in a message, on either side of 0
PLAIN_TYPES = (int, float, bool, str)


def type_name(kind: type) -> str:
    """The identity of a message class: `Range`, or `my_package/Range` of another package.

    The package of a class in a block's own file, whose module is `my_block~HASH`, is `my_block`.
    """
    name = kind.__name__
    package = kind.__module__.partition(".")[0].partition("~")[0]
    return name if BUILT_IN.get(name) is kind else f"{package}/{name}"


def full_name(kind: type) -> str:
    """As `type_name`, with the package of built-in classes too: to distinguish two of one name."""
    name = type_name(kind)
    return name if "/" in name else f"diffbotctl/{name}"


def parts(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def is_tuple(hint: Any) -> bool:
    """Whether a type is `tuple[...]`."""
    return get_origin(hint) is tuple


def is_record(hint: Any) -> bool:
    return isinstance(hint, type) and issubclass(hint, tuple) and hasattr(hint, "_fields")


def records_in(hint: Any) -> list[Any]:
    """The NamedTuples in a field's type, themselves or as items of a tuple."""
    if is_record(hint):
        return [hint]
    return [record for part in get_args(hint) for record in records_in(part)]


def type_problem(kind: type) -> tuple[str, str] | None:
    """Cause and fix if messages of class `kind` cannot be recorded; None if they can."""
    if not is_record(kind):
        return "it is not a NamedTuple", f"write class {kind.__name__}(NamedTuple)"
    names = getattr(kind, "_fields", ())
    try:
        declared = fields(kind)
    except (TypeError, NameError, SyntaxError) as error:
        return f"the types of its fields cannot be read: {error}", "correct the annotations"
    if names[:1] != ("time",) or declared["time"][0] is not int:
        return "its first field is not `time: int`", "add it: logical time in ns"
    return _fields_problem(kind, 0)


def _fields_problem(kind: type, depth: int) -> tuple[str, str] | None:
    declared = fields(kind)
    if list(declared) != list(getattr(kind, "_fields", ())):
        return "its fields differ from its annotations", "declare each field with its type"
    if len(declared) > FIELDS_MAX:
        return f"it has more than {FIELDS_MAX} fields", "put some into a NamedTuple of their own"
    for name, (hint, _) in declared.items():
        problem = _hint_problem(hint, depth)
        if problem is not None:
            return f"field {name}: {problem[0]}", problem[1]
    return None


def _hint_problem(hint: Any, depth: int) -> tuple[str, str] | None:
    if depth > NESTING_MAX:
        return f"it is nested more than {NESTING_MAX} deep", "use a flatter message"
    options = [part for part in parts(hint) if part is not NoneType]
    has_text = any(part is str or get_origin(part) is Literal for part in options)
    is_compound = any(is_tuple(part) or is_record(part) for part in options)
    if len(options) != 1 and (has_text or is_compound or not options):
        return f"{_text(hint)} has several meanings", "use one type, or one type and None"
    for part in options:
        problem = _part_problem(part, depth)
        if problem is not None:
            return problem
    return None


def _part_problem(part: Any, depth: int) -> tuple[str, str] | None:
    if part in PLAIN_TYPES:
        return None
    if get_origin(part) is Literal:
        if all(type(choice) is str for choice in get_args(part)):
            return None
        return f"{_text(part)} has a choice that is no text", "use int, or texts"
    if is_tuple(part):
        items = [item for item in get_args(part) if item is not ...]
        problems = (_hint_problem(item, depth + 1) for item in items)
        return next((problem for problem in problems if problem is not None), None)
    if is_record(part):
        return _fields_problem(part, depth + 1)
    fix = "use int, float, bool, str, Literal, a NamedTuple, or tuple[...] of these"
    return f"{_text(part)} cannot be recorded", fix


def _text(hint: Any) -> str:
    return hint.__name__ if isinstance(hint, type) and not get_args(hint) else str(hint)
