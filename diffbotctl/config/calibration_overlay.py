"""Values that `calibrate` found, laid over the fields that they are about."""

from __future__ import annotations

from typing import Any, get_args, get_origin

from diffbotctl.config.robot import Robot
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Problem, closest_match
from diffbotctl.params import Declaration, Section, declared


def overlay_calibration(robot: Value, problems: list[Problem]) -> Value:
    """The robot file with each entry of `calibration` in the place of its field."""
    section = robot.entries.get("calibration")
    for path, entry in (section.entries if section else {}).items():
        place = entry.key or entry.spot
        if field(path) is None:
            problems.append(_unknown(path, place))
            continue
        value = entry.entries.get("value")
        if value is not None:
            robot = robot.with_entry(path.split("."), value)
    return robot


def field(path: str) -> Declaration | None:
    """The declaration of the robot file's field at dotted `path`, or None."""
    kind: Any = Robot
    found: Declaration | None = None
    for step in path.split("."):
        if get_origin(kind) is dict:
            kind = get_args(kind)[1]
            continue
        if not (isinstance(kind, type) and issubclass(kind, Section)):
            return None
        found = next((each for each in declared(kind).values() if each.key == step), None)
        if found is None:
            return None
        kind = found.kind
    is_leaf = not (isinstance(kind, type) and issubclass(kind, Section))
    return found if is_leaf and get_origin(kind) is not dict else None


def paths(kind: type[Section] = Robot, before: str = "") -> list[str]:
    """Every field of the robot file by dotted path, without the maps of sensors."""
    found: list[str] = []
    for setting in declared(kind).values():
        if isinstance(setting.kind, type) and issubclass(setting.kind, Section):
            found += paths(setting.kind, f"{before}{setting.key}.")
        else:
            found.append(before + setting.key)
    return found


def _unknown(path: str, place: Any) -> Problem:
    below = [each for each in paths() if each.startswith(f"{path}.")]
    if below:
        cause = f"'{path}' is a whole section; one value at a time is calibrated"
        return Problem("E-CALIBRATION", place, cause, f"name a field of it, such as {below[0]}")
    near = closest_match(path, paths())
    cause = f"the robot file has no field '{path}'"
    fix = f"did you mean {near}?" if near else "name a field by its path, such as drive.track"
    return Problem("E-CALIBRATION", place, cause, fix)
