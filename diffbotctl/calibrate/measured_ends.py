"""The ends of drives, which a person measured at rest and noted in a table."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite, isnan, nan, pi, radians
from pathlib import Path

import numpy as np

from diffbotctl.calibrate.csv_table import CsvTable, open_table, unusable_log
from diffbotctl.calibrate.dead_reckoning import wrap_angle
from diffbotctl.calibrate.log_checks import part_fault
from diffbotctl.calibrate.log_reader import DEGREES, HEADING_MAX_RAD, POSE_COLUMNS, CountLog

END_DISTANCE_RATIO_MAX = 1.5  # of the distance to what the wheels rolled
SAME_HEADING_RAD = radians(1.0)


def read_ends(path: Path) -> dict[str, tuple[float, float, float]]:
    """End poses by the name of the drive's file, without its suffix.

    Columns: recording, x and y (m), and heading (rad) or heading_deg, which may be empty. Raises
    UsageError.
    """
    table = open_table(path, ("recording", *POSE_COLUMNS[:2]))
    ends: dict[str, tuple[float, float, float]] = {}
    for line, cells in table.rows():
        name = Path(cells[table.column("recording")]).stem
        if name in ends:
            raise unusable_log(path, f"has two lines for the recording {name}")
        ends[name] = _end(table, line, cells)
    if len(ends) > 1 and not any(x or y for x, y, _ in ends.values()):
        raise unusable_log(path, "x and y are 0 in every line", "write the measured ends")
    return ends


def _end(table: CsvTable, line: int, cells: Sequence[str]) -> tuple[float, float, float]:
    """The end pose in one line: x, y in m, heading in rad or nan."""
    values = {
        name: table.number(line, name, cells[table.column(name)])
        for name in (*POSE_COLUMNS, DEGREES)
        if name in table.names
    }
    given = [values.get(POSE_COLUMNS[2], nan), radians(values.get(DEGREES, nan))]
    given = [heading for heading in given if not isnan(heading)]
    if len(given) == 2 and abs(wrap_angle(given[0] - given[1])) > SAME_HEADING_RAD:
        cause = f"line {line} states one heading in rad and another one in degrees"
        raise unusable_log(table.path, cause, f"write heading or {DEGREES}")
    heading = given[0] if given else nan
    if abs(heading) > HEADING_MAX_RAD:
        raise unusable_log(table.path, f"line {line} states a heading of more than 100 turns")
    return values["x"], values["y"], heading


def refuse_part(counts: CountLog) -> None:
    """Raises UsageError for a drive that does not begin and end at rest, where its end is."""
    fault = part_fault(counts.times, counts.turns / counts.tick)
    if fault is not None:
        fix = "record from before the robot moves until it stands again"
        raise unusable_log(Path(counts.name), fault, fix)


def refuse_too_far(counts: CountLog, end: Sequence[float], diameter: float, path: Path) -> None:
    """Raises UsageError if wheels of `diameter` (m) cannot have reached `end` (m) of `path`, or it
    has no x or y.

    The most common cause is a wrong unit.
    """
    rolled = pi * diameter * float(np.abs(np.diff(counts.turns, axis=0)).sum(axis=0).max())
    distance = hypot(end[0], end[1])
    if not isfinite(distance):
        raise unusable_log(path, f"states no x or no y of the end of {counts.name}")
    if distance > END_DISTANCE_RATIO_MAX * rolled:
        cause = f"states that {counts.name} ended {distance:.4g} m from its start, but its wheels "
        fix = "write x and y in metres, and counts since the start; `slots` are counts per turn"
        raise unusable_log(path, f"{cause}rolled only {rolled:.3g} m", fix)
