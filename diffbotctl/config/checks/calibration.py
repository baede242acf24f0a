"""Checks of calibrated values: plausible against the stated ones, and present where needed."""

from __future__ import annotations

import re
from datetime import date
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.block import robot_fields
from diffbotctl.config import robot_tree
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.lookup import is_simulated_copy, original_of
from diffbotctl.config.robot import SIDES, Calibrated, Robot
from diffbotctl.errors import Place, join_words
from diffbotctl.geometry.distance_sensors import is_analog
from diffbotctl.units import UnitError, quantity


class PlausibleRatio(NamedTuple):
    """What a calibrated value may be, in proportion to the one that the file states.

    `reason` explains a value outside.
    """

    minimum: float
    maximum: float
    reason: str


# Field -> ratio. What is not listed has only the bounds of its field.
PLAUSIBLE = {
    r"drive\.track": PlausibleRatio(0.7, 1.4, "measure the track between the tyre centres"),
    r"drive\.(left|right)\.wheel\.diameter": PlausibleRatio(
        0.85, 1.18, "the rolling diameter is close to the one measured with a ruler"
    ),
    r"drive\.(left|right)\.encoder\.slots": PlausibleRatio(0.2, 5.0, "count the slots of the disc"),
    r"drive\.(left|right)\.motor\.rated": PlausibleRatio(
        0.3, 2.5, "check the motor's label, the supply and the number of slots"
    ),
    r"sensors\.\w+\.curve\.a": PlausibleRatio(
        0.5, 2.0, "sensors of one type differ less; check the unit of the measured distances"
    ),
    r"battery\.divider": PlausibleRatio(0.5, 2.0, "check the resistors of the divider"),
}
DIAMETER_RATIO_MAX = 1.08  # of both wheels; a larger one makes the robot visibly drive a circle
SD_RATIO_MAX = 0.5  # of a calibrated length, speed or scale
MOTOR_LAG_MAX_S = 0.8  # no usable gear motor of this size is slower

# Field that blocks read -> the calibration that measures it.
FOUND_BY = {
    "drive.track": "geometry",
    "drive.left.wheel.diameter": "geometry",
    "drive.right.wheel.diameter": "geometry",
    "drive.left.motor.lag": "motors",
    "drive.right.motor.lag": "motors",
}


def found_by(robot: Robot) -> dict[str, str]:
    """Field of `robot` that blocks read -> the calibration that measures it."""
    sensors = {
        f"sensors.{name}.curve.a": "range"
        for name, sensor in (robot.sensors or {}).items()
        if sensor.type is not None and is_analog(sensor.type)
    }
    imu = {} if robot.imu is None or robot.imu.type is None else {"imu.scale": "imu"}
    return FOUND_BY | sensors | imu


# Calibration -> what of the pose depends on it.
POSE_CALIBRATIONS = {"geometry": "track and wheel diameters", "imu": "scale of the gyro"}


def uncalibrated_pose(robot: Robot) -> dict[str, str]:
    """Calibration that the robot lacks -> what it would measure, on which the pose depends.

    A robot without a board exists only in the simulator, and has the values of its file.
    """
    if not robot.has_board:
        return {}
    lacking = {
        command
        for field, command in found_by(robot).items()
        if field not in (robot.calibration or {})
    }
    return {name: what for name, what in POSE_CALIBRATIONS.items() if name in lacking}


@check()
def check_calibration(context: CheckContext) -> None:
    """Refuse implausible entries; for a real robot also warn of fields never calibrated."""
    if context.robot is None:
        return
    for path, calibrated in (context.robot.calibration or {}).items():
        key, wrong = ("", "") if calibrated is None else _wrong_note(context, path, calibrated)
        if wrong:
            fix = f"calibrate again, or delete the {key}"
            context.error(
                "E-IMPLAUSIBLE", context.robot_place("calibration", path, key), wrong, fix
            )
        value, stated = context.values(path), context.nominal_values(path)
        if value is None:
            continue
        cause = _implausible(path, value[0], stated[0] if stated else None)
        cause = cause or _inconsistent(context, path)
        if cause:
            place = context.robot_place("calibration", path, "value")
            context.error("E-IMPLAUSIBLE", place, cause, "calibrate again, or delete the entry")
    if context.refuse_simulated:
        _refuse_simulated(context, context.robot)
    if context.real:
        _warn_of_uncalibrated(context, context.robot)


def _refuse_simulated(context: CheckContext, robot: Robot) -> None:
    """Refuse results of a simulated robot: they would lift limits of the real one."""
    marked = simulated_fields(robot)
    if not marked:
        return
    place = context.robot_place("calibration", marked[0], "simulated")
    others = f" and {len(marked) - 1} more" if marked[1:] else ""
    cause = (
        f"{marked[0]}{others}: measured on a simulated robot, which proves nothing about the robot "
        "at this port"
    )
    file = place.source.name if isinstance(place, Place) else ""
    fix = "delete the entries with `simulated: true`, and run `diffbotctl calibrate` on the robot"
    if is_simulated_copy(Path(file)):
        fix = f"use the robot's own file: --robot {original_of(Path(file))}"
    context.error("E-CALIBRATION-SIMULATED", place, cause, fix)


def simulated_fields(robot: Robot) -> list[str]:
    """The calibrated fields that were measured on a simulated robot."""
    entries = (robot.calibration or {}).items()
    return [field for field, entry in entries if entry is not None and entry.simulated]


def _wrong_note(context: CheckContext, path: str, calibrated: Calibrated) -> tuple[str, str]:
    """Which note beside a calibrated value cannot be, and why; an empty text if each can."""
    day, volts, key = calibrated.date, calibrated.volts, "volts"
    try:
        date.fromisoformat((day or "2026-01-31")[:10])
        if volts not in (None, "not measured") and quantity(str(volts), "V") <= 0.0:
            return key, f"{volts} is not the voltage of a battery"
        key = "sd"
        return _wrong_sd(context, path, calibrated)
    except UnitError as error:
        return key, str(error)
    except ValueError:
        return "date", f"'{day}' is no date, such as 2026-01-31"


def _wrong_sd(context: CheckContext, path: str, entry: Calibrated) -> tuple[str, str]:
    """As `_wrong_note`, of the standard deviations of a single value. Raises UnitError."""
    declaration = robot_tree.field(path)
    if declaration is None or declaration.kind is not float:
        return "", ""
    sd = quantity(str(entry.sd or 0), declaration.unit)
    own_sd = quantity(str(entry.own_sd or 0), declaration.unit)
    if entry.sd is not None and not 0.0 < sd < inf:
        return "sd", f"{entry.sd} is no standard deviation: no measurement is exact"
    if not 0.0 <= own_sd <= sd:
        return "own_sd", f"{entry.own_sd} is no part of the sd, {entry.sd or 0}"
    value = context.values(path)
    is_ratio = any(re.fullmatch(pattern, path) for pattern in PLAUSIBLE)
    if value and is_ratio and sd > SD_RATIO_MAX * value[0]:
        return "sd", f"with a standard deviation of {sd:g}, {value[0]:g} is not known at all"
    return "", ""


def _implausible(path: str, value: Any, stated: Any) -> str | None:
    """Why `value` is implausible when the file states `stated`, or None."""
    if path.endswith(".motor.lag") and value > MOTOR_LAG_MAX_S:
        return f"a lag of {value:g} s is too long for a motor that can drive a wheel of this size"
    for pattern, plausible in PLAUSIBLE.items():
        if stated and re.fullmatch(pattern, path):
            ratio = value / stated
            if not plausible.minimum <= ratio <= plausible.maximum:
                times = f"{ratio:.2f} times the stated {stated:g}"
                return f"{path} would be {times}: {plausible.reason}"
    return None


def _inconsistent(context: CheckContext, path: str) -> str | None:
    """Why a value is inconsistent with related fields, or None."""
    if path.endswith(".wheel.diameter"):
        both = context.values(*(f"drive.{side}.wheel.diameter" for side in SIDES))
        if both and max(both) > DIAMETER_RATIO_MAX * min(both):
            return f"one wheel would be {max(both) / min(both):.2f} times as large as the other"
    return None


def _warn_of_uncalibrated(context: CheckContext, robot: Robot) -> None:
    """Warn of fields that a block of the pipeline reads and that were never calibrated."""
    needed = [
        field for block in context.block_classes.values() for field in robot_fields(block).values()
    ]
    commands = {
        path: command
        for path, command in found_by(robot).items()
        if path not in (robot.calibration or {})
        and any(path == field or path.startswith(f"{field}.") for field in needed)
    }
    if not commands:
        return
    cause = f"not calibrated, but used by this pipeline: {join_words(commands, 'and')}"
    calls = [f"`diffbotctl calibrate {command}`" for command in dict.fromkeys(commands.values())]
    place = context.robot_place("calibration")
    context.warn("W-UNCALIBRATED", place, cause, f"run {join_words(calls, 'and')}")
