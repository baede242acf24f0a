"""Keys and values of robot and pipeline files that were renamed or retired within format 1.

A file that still has one is accepted, with a warning that shows the new line.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

from diffbotctl.config.robot import SIDES
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Place, Problem

CODE = "W-OUTDATED"
Steps = tuple[str, ...]


class RenamedKey(NamedTuple):
    """The key at the end of `path` is now called `new`. `*` in a path matches any key."""

    path: Steps
    new: str


class RenamedValue(NamedTuple):
    """The value `old` at `path` is now called `new`."""

    path: Steps
    old: str
    new: str


class RetiredKey(NamedTuple):
    """The key at the end of `path` has no effect any more, for `reason`."""

    path: Steps
    reason: str


Change = RenamedKey | RenamedValue | RetiredKey

DUTIES = ("start_duty", "keep_duty")
DUTY_REASON = "the speed loop uses loop.static, the simulation simulation.motor.start_duty"
ROBOT_CHANGES: tuple[Change, ...] = (
    RenamedValue(("drive", "polarity"), "by_hand", "checked_by_hand"),
    RenamedValue(("board", "type"), "atmega328p", "nano"),
    RetiredKey(("link", "range_formula"), "the firmware with rosserial has one formula, 13/V"),
    *(RetiredKey(("drive", "motor", duty), DUTY_REASON) for duty in DUTIES),
    *(RetiredKey(("drive", "*", "motor", duty), DUTY_REASON) for duty in DUTIES),
    *(
        RetiredKey(("calibration", f"drive.{side}.motor.{duty}"), DUTY_REASON)
        for side in SIDES
        for duty in DUTIES
    ),
)
PIPELINE_CHANGES: tuple[Change, ...] = ()


def update_tree(tree: Value, changes: Iterable[Change], problems: list[Problem]) -> Value:
    """`tree` with the present keys and values; a warning for each change goes to `problems`."""
    for change in changes:
        for path in _paths(tree, change.path):
            value = tree.at(*path)
            if value is not None:
                tree = _apply(change, tree, path, value, problems)
    return tree


def _paths(tree: Value, pattern: Steps) -> Iterator[Steps]:
    """The paths that are in `tree` and match `pattern`."""
    if not pattern:
        yield ()
        return
    for name, value in tree.entries.items():
        if pattern[0] in ("*", name):
            for rest in _paths(value, pattern[1:]):
                yield (name, *rest)


def _apply(
    change: Change, tree: Value, path: Steps, value: Value, problems: list[Problem]
) -> Value:
    match change:
        case RetiredKey():
            cause = f"{path[-1]} has no effect any more: {change.reason}"
            problems.append(_warning(value.name_place, cause, "remove the key"))
            return tree.with_entry(path, None)
        case RenamedKey():
            problems.append(_renamed(value.name_place, path[-1], change.new))
            return tree.with_entry(path, None).with_entry((*path[:-1], change.new), value)
        case RenamedValue():
            if value.text != change.old:
                return tree
            problems.append(_renamed(value.value_place, change.old, change.new))
            return tree.with_entry(path, replace(value, data=change.new, text=change.new))


def _renamed(place: Place, old: str, new: str) -> Problem:
    """The fix is the line at `place` with `new` in place of what is marked there."""
    line, start = place.source.line(place.line), place.column - 1
    new_line = (line[:start] + new + line[start + place.length :]).strip()
    return _warning(place, f"{old} is now called {new}", f"write `{new_line}`")


def _warning(place: Place, cause: str, fix: str) -> Problem:
    return Problem(CODE, place, cause, fix, "warning")
