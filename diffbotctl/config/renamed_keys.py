"""Keys and values of robot and pipeline files that were renamed or retired within format 1.

A file that still has one is accepted, with a warning that shows the new line.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Place, Problem

CODE = "W-OUTDATED"


class RenamedKey(NamedTuple):
    """`path` is a regular expression of the dotted path, without the last key."""

    path: str
    old: str
    new: str


class RenamedValue(NamedTuple):
    """`path` is a regular expression of the whole dotted path."""

    path: str
    old: str
    new: str


class RetiredKey(NamedTuple):
    """`path` is a regular expression of the whole dotted path."""

    path: str
    reason: str


Change = RenamedKey | RenamedValue | RetiredKey

ROBOT_CHANGES: tuple[Change, ...] = (
    RenamedValue(r"drive\.polarity", "by_hand", "checked_by_hand"),
    RetiredKey(r"link\.range_formula", "the firmware with rosserial has one formula, 13/V"),
    RetiredKey(
        r"(calibration\.)?drive\.((left|right)\.)?motor\.(start_duty|keep_duty)",
        "the speed loop uses loop.static, the simulation simulation.motor.start_duty",
    ),
)
PIPELINE_CHANGES: tuple[Change, ...] = ()


def update_tree(tree: Value, changes: Sequence[Change], problems: list[Problem]) -> Value:
    """`tree` with the present keys and values; a warning for each change goes to `problems`."""
    return _update_mapping(tree, "", changes, problems)


def _update_mapping(
    mapping: Value, prefix: str, changes: Sequence[Change], problems: list[Problem]
) -> Value:
    if not isinstance(mapping.data, dict):
        return mapping
    entries: dict[str, Value] = {}
    for key, value in mapping.data.items():
        path = f"{prefix}{key}"
        change = _change_of(path, key, value, changes)
        match change:
            case RetiredKey():
                cause = f"{key} has no effect any more: {change.reason}"
                problems.append(_warning(value.name_place, cause, "remove the key"))
                continue
            case RenamedValue():
                cause = f"{change.old} is now called {change.new}"
                fix = f"write `{_line_with(value.value_place, change.new)}`"
                problems.append(_warning(value.value_place, cause, fix))
                value = replace(value, data=change.new, text=change.new)
            case RenamedKey():
                place = value.name_place
                cause = f"{change.old} is now called {change.new}"
                fix = f"write `{_line_with(place, change.new)}`"
                problems.append(_warning(place, cause, fix))
                key, path = change.new, f"{prefix}{change.new}"
        entries[key] = _update_mapping(value, f"{path}.", changes, problems)
    return replace(mapping, data=entries)


def _change_of(path: str, key: str, value: Value, changes: Sequence[Change]) -> Change | None:
    for change in changes:
        match change:
            case RetiredKey():
                applies = re.fullmatch(change.path, path) is not None
            case RenamedValue():
                applies = value.text == change.old and re.fullmatch(change.path, path) is not None
            case RenamedKey():
                parent = path[: -len(key)].rstrip(".")
                applies = key == change.old and re.fullmatch(change.path, parent) is not None
        if applies:
            return change
    return None


def _line_with(place: Place, new: str) -> str:
    """The line at `place` with `new` in place of what is marked there."""
    line = place.source.line(place.line)
    start = place.column - 1
    return (line[:start] + new + line[start + place.length :]).strip()


def _warning(place: Place, cause: str, fix: str) -> Problem:
    return Problem(CODE, place, cause, fix, "warning")
