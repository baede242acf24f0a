"""Names of blocks and sensors: plain words that a wire can carry."""

from __future__ import annotations

import re

from diffbotctl.config.case import Case
from diffbotctl.config.nodes import RESERVED, ROBOT
from diffbotctl.config.schema import NAME
from diffbotctl.config.value import Value


def check(case: Case) -> None:
    """Refuse names that are no plain words, and those that mean something else."""
    for name, value in _entries(case.at("blocks")):
        _check_word(case, name, value, "block")
        if name in RESERVED:
            cause = f"'{name}' is the name of a node that every pipeline has"
            case.error("E-NAME", value.key or value.spot, cause, "give the block another name")
    for name, value in _entries(case.robot_at("sensors")):
        _check_word(case, name, value, "sensor")
        if name in ROBOT:
            cause = f"'{name}' is already an output of the robot"
            case.error("E-NAME", value.key or value.spot, cause, "give the sensor another name")


def _entries(value: Value | None) -> list[tuple[str, Value]]:
    return list(value.entries.items()) if value else []


def _check_word(case: Case, name: str, value: Value, what: str) -> None:
    if re.fullmatch(NAME.strip("^$"), name):
        return
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    plain = plain if plain[:1].isalpha() else f"{what}_{plain}".rstrip("_")
    cause = f"'{name}' cannot name a {what}: small letters, digits and _ make a name"
    case.error("E-NAME", value.key or value.spot, cause, f"call it {plain}")
