"""Completes the tree of a robot: common values copied to both sides, calibrated values applied."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args, get_origin

from diffbotctl.config.robot import SIDES, Robot, SideSection
from diffbotctl.config.yaml_tree import Data, Value
from diffbotctl.errors import Place, Problem, closest_match
from diffbotctl.params import Declaration, Section, declared


def copy_common_to_sides(robot: Value) -> Value:
    """The robot file with the common parts of `drive` copied into `left` and `right`.

    The values of a side override the common ones.
    """
    for side in SIDES:
        own = robot.at("drive", side)
        if own is None or not isinstance(own.data, dict):
            continue
        for part in declared(SideSection):
            common = robot.at("drive", part)
            if common is None:
                continue
            stated = own.entries.get(part)
            if stated is None or not isinstance(common.data, dict):
                part_value = replace(common, key_place=own.key_place)
            else:
                part_value = stated.merged_over(common)
            robot = robot.with_entry(("drive", side, part), part_value)
    return robot


def spell_out_missing_encoders(robot: Value) -> Value:
    """The robot file with each `encoder: none` written as an encoder with no channel."""
    for steps in (("drive", "encoder"), *(("drive", side, "encoder") for side in SIDES)):
        value = robot.at(*steps)
        if value is None or value.data != "none" or value.quoted:
            continue
        channels, slots = replace(value, data=0, text="0"), replace(value, data=1, text="1")
        pin = replace(value, data="none")
        entries: Data = {"channels": channels, "slots": slots, "pin": pin}
        robot = robot.with_entry(steps, replace(value, data=entries, text="", flow=True))
    return robot


def overlay_calibration(robot: Value, problems: list[Problem]) -> Value:
    """The robot file with each entry of `calibration` in the place of its field."""
    section = robot.entries.get("calibration")
    for path, entry in (section.entries if section else {}).items():
        if field(path) is None:
            problems.append(_unknown_field(path, entry.name_place))
            continue
        value = entry.entries.get("value")
        if value is not None:
            robot = robot.with_entry(path.split("."), value)
    return robot


def field(path: str) -> Declaration | None:
    """The declaration of the robot file's field at dotted `path`, or None."""
    kind: Any = Robot
    declaration: Declaration | None = None
    for step in path.split("."):
        if get_origin(kind) is dict:
            kind = get_args(kind)[1]
            continue
        if not _is_section(kind):
            return None
        by_key = {setting.key: setting for setting in declared(kind).values()}
        declaration = by_key.get(step)
        if declaration is None:
            return None
        kind = declaration.kind
    return None if _is_section(kind) or get_origin(kind) is dict else declaration


def field_paths(kind: type[Section] = Robot, prefix: str = "") -> list[str]:
    """Every field of the robot file by dotted path, without the maps of sensors."""
    paths: list[str] = []
    for declaration in declared(kind).values():
        path = prefix + declaration.key
        if _is_section(declaration.kind):
            paths += field_paths(declaration.kind, f"{path}.")
        else:
            paths.append(path)
    return paths


def _is_section(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Section)


def _unknown_field(path: str, place: Place) -> Problem:
    paths = field_paths()
    below = [field for field in paths if field.startswith(f"{path}.")]
    if below:
        cause = f"'{path}' is a section; calibration entries are for single fields"
        fix = f"name a field of it, such as {below[0]}"
    else:
        near = closest_match(path, paths)
        cause = f"the robot file has no field '{path}'"
        fix = f"did you mean {near}?" if near else "name a field by its path, such as drive.track"
    return Problem("E-CALIBRATION", place, cause, fix)
