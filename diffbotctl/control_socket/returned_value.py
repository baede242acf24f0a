"""What an action returns, as values that an answer on the control socket can carry."""

from __future__ import annotations

from typing import Any

from diffbotctl.recording.json_codec import plain

TEXT_MAX_LENGTH = 10_000  # characters
PARTS_MAX = 1000  # of a tuple
NESTING_MAX = 2  # of tuples and messages


def sendable_value(value: Any, depth: int = 0) -> Any:
    """`value` as JSON types; nan and infinities as texts. Raises ValueError for other values."""
    if hasattr(value, "_asdict"):
        return dict(zip(value._fields, _parts(value, depth), strict=True))
    if isinstance(value, tuple | list):
        return _parts(value, depth)
    result = plain(value)
    if not (result is None or isinstance(result, bool | int | float | str)):
        raise ValueError(f"it is a {type(value).__name__}")
    if isinstance(result, str) and len(result) > TEXT_MAX_LENGTH:
        raise ValueError(f"it is a text of more than {TEXT_MAX_LENGTH} characters")
    return result


def _parts(values: tuple[Any, ...] | list[Any], depth: int) -> list[Any]:
    if len(values) > PARTS_MAX or depth > NESTING_MAX:
        raise ValueError(f"it has more than {PARTS_MAX} parts, or is nested too deeply")
    return [sendable_value(value, depth + 1) for value in values]
