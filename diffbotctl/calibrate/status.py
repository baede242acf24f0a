"""What was calibrated of a robot, how long ago, and what was not."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import NamedTuple

from diffbotctl.config.checks.calibration import found_by
from diffbotctl.config.configuration import RobotFile

DATE = "%Y-%m-%dT%H:%MZ"
MINUTE, HOUR, DAY = 60, 3600, 86_400  # s


class CalibrationEntry(NamedTuple):
    """One entry as a person reads it."""

    field: str
    value: str
    sd: str
    age: str
    method: str
    volts: str
    recording: str


def stamp(now: datetime) -> str:
    """The time as entries carry it, in UTC."""
    return now.astimezone(UTC).strftime(DATE)


def calibration_entries(file: RobotFile, now: datetime) -> list[CalibrationEntry]:
    """Every entry of the robot's `calibration:`, in its order."""
    return [
        CalibrationEntry(
            field,
            _short(entry.value),
            _short(entry.sd),
            age(entry.date, now),
            entry.method or "",
            str(entry.volts or ""),
            (entry.recording or "")[:12],
        )
        for field, entry in file.robot.calibration.items()
    ]


def missing(file: RobotFile) -> dict[str, str]:
    """What was never calibrated though most pipelines rely on it -> the command that finds it."""
    return {
        path: by for path, by in found_by(file.robot).items() if path not in file.robot.calibration
    }


def age(date: str | None, now: datetime) -> str:
    """How long before `now` (aware) that was, in the largest unit that fits."""
    try:
        then = datetime.strptime(date or "", DATE).replace(tzinfo=UTC)
    except ValueError:
        return date or ""
    seconds = (now - then).total_seconds()
    for length, name in ((DAY, "day"), (HOUR, "hour"), (MINUTE, "minute")):
        if seconds >= length:
            count = int(seconds / length)
            return f"{count} {name}{'s' * (count != 1)} old"
    return "just now" if seconds > -MINUTE else "in the future: check the clock"


def _short(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, list):
        return f"{len(value)} values"
    return str(value)
