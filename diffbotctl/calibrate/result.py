"""Findings of a calibration, their uncertainty and provenance, and the entries of a robot."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from math import isfinite
from typing import NamedTuple

from diffbotctl.config import robot_tree
from diffbotctl.config.checks.calibration import found_by
from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.motor_pulses import DEPENDS_ON_PULSES
from diffbotctl.config.robot import PulsedPins
from diffbotctl.params import with_unit

RIGHT_DIAMETER, LEFT_DIAMETER = "drive.right.wheel.diameter", "drive.left.wheel.diameter"
TRACK = "drive.track"
SLIP = "drive.slip"
GYRO_SCALE, GYRO_AXES = "imu.scale", "imu.axes"
NOT_MEASURED = "not measured"
# Significant digits that are written. A tape measure gives four at best, but what two wheels differ
# by is known far better than what they have in common.
VALUE_DIGITS, SD_DIGITS = 6, 2
PART_SD_DIGITS = 3  # where the rest is the difference of two squares

FindingValue = float | str | bool


class Finding(NamedTuple):
    """One field of the robot file and its value in SI."""

    field: str
    value: FindingValue
    sd: float | None = None
    """standard deviation, in the value's unit; None where there is nothing to deviate"""
    own_sd: float | None = None
    """of a diameter or the track: what is left of `sd` when the mean diameter is known exactly"""
    method: str = ""
    """of a value that was found by another step and is only adapted; empty: that of this step"""


class PartResult(NamedTuple):
    """What a part of a step came to."""

    findings: list[Finding]
    faults: list[str]  # what only a hand mends
    report: list[str]


class Provenance(NamedTuple):
    """Common properties of the findings of one step."""

    method: str
    date: str  # UTC, such as 2026-05-01T09:30Z
    volts: float | None  # of the battery; None if it was not measured
    recording: str | None  # hash of the recording
    simulated: bool = False  # whether the robot was a simulated one
    pulses: PulsedPins | None = None  # where the motors got their pulses


def formatted_value(finding: Finding, origin: Provenance) -> str:
    """The entry as it stands behind the field's path in the robot file.

    Raises ValueError for a value or deviation that is not finite.
    """
    unit = _unit(finding.field)
    entries = {"value": _format_value(finding.value, unit)}
    if finding.sd:
        digits = SD_DIGITS if finding.own_sd is None else PART_SD_DIGITS
        entries["sd"] = _format_value(finding.sd, unit, digits)
        if finding.own_sd is not None:
            entries["own_sd"] = _format_value(finding.own_sd, unit, digits)
    volts = NOT_MEASURED if origin.volts is None else with_unit(round(origin.volts, 2), "V")
    entries |= {"date": json.dumps(origin.date), "method": finding.method or origin.method}
    entries["volts"] = volts
    if origin.recording:
        entries["recording"] = json.dumps(origin.recording)
    if origin.pulses and DEPENDS_ON_PULSES.fullmatch(finding.field):
        entries["pulses"] = origin.pulses
    if origin.simulated:
        entries["simulated"] = "true"
    return "{" + ", ".join(f"{name}: {text}" for name, text in entries.items()) + "}"


def _unit(field: str) -> str:
    declaration = robot_tree.field(field)
    if declaration is None:
        raise ValueError(f"robot files have no field {field}")
    return declaration.unit


def _format_value(value: FindingValue, unit: str, digits: int = VALUE_DIGITS) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value
    if not isfinite(value):
        raise ValueError(f"{value} is no result")
    number = f"{value:.{digits}g}"
    return number if unit in ("", "1") else f"{number} {unit}"


DATE_FORMAT = "%Y-%m-%dT%H:%MZ"
MINUTE, HOUR, DAY = 60, 3600, 86_400  # s


class CalibrationEntry(NamedTuple):
    """One entry, as text."""

    field: str
    value: str
    sd: str
    age: str
    method: str
    volts: str
    recording: str


def format_date(now: datetime) -> str:
    """The date format of entries, in UTC."""
    return now.astimezone(UTC).strftime(DATE_FORMAT)


def calibration_entries(file: RobotFile, now: datetime) -> list[CalibrationEntry]:
    """All entries of the robot's section `calibration:`, in order."""
    return [
        CalibrationEntry(
            field,
            str(entry.value),
            "" if entry.sd is None else str(entry.sd),
            format_age(entry.date, now),
            f"{entry.method or ''}{' (SIMULATED robot)' if entry.simulated else ''}",
            str(entry.volts or ""),
            (entry.recording or "")[:12],
        )
        for field, entry in file.robot.calibration.items()
    ]


def missing_entries(file: RobotFile) -> dict[str, str]:
    """Fields that were never calibrated, and the command that calibrates each."""
    return {
        path: by for path, by in found_by(file.robot).items() if path not in file.robot.calibration
    }


def format_age(date: str | None, now: datetime) -> str:
    """The age at `now` (with time zone), in the largest unit that fits."""
    try:
        then = datetime.strptime(date or "", DATE_FORMAT).replace(tzinfo=UTC)
    except ValueError:
        return date or ""
    seconds = (now - then).total_seconds()
    for length, name in ((DAY, "day"), (HOUR, "hour"), (MINUTE, "minute")):
        if seconds >= length:
            count = int(seconds / length)
            return f"{count} {name}{'s' * (count != 1)} old"
    return "just now" if seconds > -MINUTE else "in the future: check the clock"
