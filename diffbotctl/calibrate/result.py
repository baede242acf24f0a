"""What a calibration found, how sure it is, and where it comes from."""

from __future__ import annotations

import json
from math import isfinite
from typing import NamedTuple

from diffbotctl.config import calibration_overlay
from diffbotctl.params import with_unit

NOT_MEASURED = "not measured"
# Significant digits that are written. A tape tells four at best, but what two wheels differ by is
# known far better than what they have in common.
DIGITS, DOUBT = 6, 2

FindingValue = float | str | bool | tuple[float, ...]


class Finding(NamedTuple):
    """One field of the robot file and its value in SI."""

    field: str
    value: FindingValue
    sd: float | None = None
    """standard deviation, in the value's unit; None where there is nothing to deviate"""


class PartResult(NamedTuple):
    """What a part of a step came to."""

    findings: list[Finding]
    faults: list[str]
    """what only a hand mends"""
    report: list[str]


class Provenance(NamedTuple):
    """What findings have in common that were made together."""

    method: str
    date: str
    """UTC, such as 2026-05-01T09:30Z"""
    volts: float | None
    """of the battery; None when nobody measured it"""
    recording: str | None
    """hash of the recording that they were found from"""


def formatted_value(finding: Finding, origin: Provenance) -> str:
    """The entry as it stands behind the field's path in the robot file.

    Raises ValueError for a value or deviation that is not finite.
    """
    unit = _unit(finding.field)
    entries = {"value": _value(finding.value, unit)}
    if finding.sd is not None:
        entries["sd"] = _value(finding.sd, unit, DOUBT)
    volts = NOT_MEASURED if origin.volts is None else with_unit(round(origin.volts, 2), "V")
    entries |= {"date": json.dumps(origin.date), "method": origin.method, "volts": volts}
    if origin.recording:
        entries["recording"] = json.dumps(origin.recording)
    return "{" + ", ".join(f"{name}: {text}" for name, text in entries.items()) + "}"


def _unit(field: str) -> str:
    declaration = calibration_overlay.field(field)
    if declaration is None:
        raise ValueError(f"robot files have no field {field}")
    return declaration.unit


def _value(value: FindingValue, unit: str, digits: int = DIGITS) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_value(each, unit) for each in value)}]"
    if isinstance(value, str):
        return value
    if not isfinite(value):
        raise ValueError(f"{value} is no result")
    number = f"{value:.{digits}g}"
    return number if unit in ("", "1") else f"{number} {unit}"
