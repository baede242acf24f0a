"""What both sides of a drive share is copied into each side; what a side says wins."""

from __future__ import annotations

from diffbotctl.config.include import merge
from diffbotctl.config.robot import SideSection
from diffbotctl.config.yaml_tree import Value
from diffbotctl.params import declared

SIDES = ("left", "right")


def copy_common_to_sides(robot: Value) -> Value:
    """The robot file with the common parts of `drive` copied into `left` and `right`."""
    for side in SIDES:
        own = robot.at("drive", side)
        if own is None or not isinstance(own.data, dict):
            continue
        for part in declared(SideSection):
            common = robot.at("drive", part)
            if common is None:
                continue
            mine = own.entries.get(part)
            whole = common.with_key(own.key) if mine is None else merge(common, mine)
            robot = robot.with_entry(("drive", side, part), whole)
    return robot
