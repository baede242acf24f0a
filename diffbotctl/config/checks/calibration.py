"""Calibrated values are near the stated ones, and what matters to the pipeline was calibrated."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from diffbotctl.block import robot_fields
from diffbotctl.config.checks.context import CheckContext
from diffbotctl.config.robot import SIDES
from diffbotctl.errors import join_words


class PlausibleRange(NamedTuple):
    """What a calibrated value may be, as a share of the one that the file states."""

    least: float
    most: float
    why: str
    """what it would mean otherwise"""


HALF = "a track is measured between the middles of both tyres"
TYRE = "a tyre's rolling diameter is what a rule across it tells, give or take its tread"
# Field -> range. What is not listed has only the bounds of its field.
PLAUSIBLE = {
    r"drive\.track": PlausibleRange(0.7, 1.4, HALF),
    r"drive\.(left|right)\.wheel\.diameter": PlausibleRange(0.85, 1.18, TYRE),
    r"drive\.(left|right)\.encoder\.slots": PlausibleRange(0.2, 5.0, "count the slots of the disc"),
    r"drive\.(left|right)\.motor\.rated": PlausibleRange(
        0.3, 2.5, "the motor's label, the supply or the encoder's slots must be wrong then"
    ),
    r"sensors\.\w+\.curve\.a": PlausibleRange(
        0.5, 2.0, "no part of this kind differs so much: was the rule read in the right unit?"
    ),
    r"battery\.divider": PlausibleRange(
        0.5, 2.0, "the resistors of the divider are other ones then"
    ),
}
MOST_RATIO = 1.08  # between both wheels' diameters: more drives a circle that nobody could miss
LONGEST_LAG = 0.8  # s; a gear motor of this size that is slower cannot be driven by anything

# What blocks read -> the command that finds it.
FOUND_BY = {
    "drive.track": "geometry",
    "drive.left.wheel.diameter": "geometry",
    "drive.right.wheel.diameter": "geometry",
    "drive.left.motor.lag": "motors",
    "drive.right.motor.lag": "motors",
}


def found_by(robot: Any) -> dict[str, str]:
    """What blocks read of `robot` -> the command that finds it."""
    sensors = {f"sensors.{name}.curve.a": "range" for name in robot.sensors or {}}
    return FOUND_BY | sensors


def check_calibration(context: CheckContext) -> None:
    """Refuse implausible entries; before a real robot moves, name what was never calibrated."""
    if context.robot is None or context.nominal is None:
        return
    for path in context.robot.calibration or {}:
        known, stated = context.values(path), context.nominal_values(path)
        if known is None:
            continue
        why = _implausible(path, known[0], stated[0] if stated else None) or _unlike(context, path)
        if why:
            place = context.robot_value("calibration", path, "value")
            fix = "calibrate again, or delete the entry"
            context.error("E-IMPLAUSIBLE", place.place if place else path, why, fix)
    if context.real:
        _name_uncalibrated(context)


def _implausible(path: str, value: Any, stated: Any) -> str | None:
    """Why `value` cannot be true where the file states `stated`, or None."""
    if path.endswith(".motor.lag") and value > LONGEST_LAG:
        return f"a lag of {value:g} s: no motor that turns a wheel of this size is so slow"
    for pattern, allowed in PLAUSIBLE.items():
        if not re.fullmatch(pattern, path) or not stated:
            continue
        share = value / stated
        if not allowed.least <= share <= allowed.most:
            times = f"{share:.2f} times the stated {stated:g}"
            return f"{path} would be {times}: {allowed.why}"
    return None


def _unlike(context: CheckContext, path: str) -> str | None:
    """Why a value does not go with its neighbours, or None."""
    side = next((each for each in SIDES if path.startswith(f"drive.{each}.encoder.")), None)
    if side and path.endswith((".slot_errors", ".back_errors")):
        known = context.values(path, f"drive.{side}.encoder.slots")
        if known and len(known[0]) != known[1]:
            return f"{len(known[0])} errors for a disc with {known[1]} slots"
    if path.endswith(".wheel.diameter"):
        both = context.values(*(f"drive.{each}.wheel.diameter" for each in SIDES))
        if both and max(both) > MOST_RATIO * min(both):
            return f"one wheel would be {max(both) / min(both):.2f} times as large as the other"
    return None


def _name_uncalibrated(context: CheckContext) -> None:
    assert context.robot is not None
    done, by = set(context.robot.calibration or {}), found_by(context.robot)
    needed = set(_needed(context, by))
    missing = [path for path in by if path not in done and path in needed]
    if not missing:
        return
    commands = dict.fromkeys(by[path] for path in missing)
    cause = f"never calibrated, and this pipeline relies on it: {join_words(missing, 'and')}"
    fix = f"run {join_words((f'`diffbotctl calibrate {each}`' for each in commands), 'and')}"
    context.warn("W-UNCALIBRATED", context.robot_place("calibration"), cause, fix)


def _needed(context: CheckContext, by: dict[str, str]) -> Iterator[str]:
    """Which of these fields some block of the pipeline reads."""
    for kind in context.block_classes.values():
        for wanted in robot_fields(kind).values():
            for path in by:
                if path == wanted or path.startswith(f"{wanted}."):
                    yield path
