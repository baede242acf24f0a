"""Sessions of the OptiOdom data set.

OptiOdom: Sousa, Petry, Costa & Moreira, "OptiOdom: a Generic Approach for Odometry Calibration of
Wheeled Mobile Robots", J. Intelligent & Robotic Systems 105:39, 2022. A session is a folder with
`<session>_run-NN.csv` (no header: time s, x m, y m, heading rad, and the ticks of the right and
left wheel in the cycle) and `<session>_metadata.csv`. Ground truth is a motion capture system.
"""

from __future__ import annotations

import csv
from contextlib import suppress
from math import inf, isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.csv_table import CSV_ENCODING, error_text, read_table, unusable_log
from diffbotctl.calibrate.dead_reckoning import MOTION_CAPTURE, Geometry, RecordedDrive
from diffbotctl.calibrate.log_checks import ticks_gap
from diffbotctl.config.yaml_reader import open_regular
from diffbotctl.errors import Problem, UsageError

RUN_COLUMNS = 6
DESCRIPTION_MAX_BYTES = 1 << 20


class OptiodomSession(NamedTuple):
    """One folder."""

    name: str
    nominal: Geometry
    side: float | None
    """m, of the squares; None if there are none"""
    drives: list[RecordedDrive]


def is_session(folder: Path) -> bool:
    """Whether `folder` contains run files and their description."""
    return any(folder.glob("*_metadata.csv")) and any(folder.glob("*_run-*.csv"))


def read_session(folder: Path) -> OptiodomSession:
    """The session in `folder`. Raises UsageError for an incomplete one."""
    paths = sorted(folder.glob("*_run-*.csv"))
    if not paths:
        cause = "contains no *_run-*.csv files"
        raise UsageError(
            Problem("E-CALIBRATE-LOG", str(folder), cause, "give the folder of a session")
        )
    values = _read_description(next(iter(folder.glob("*_metadata.csv")), folder / "metadata.csv"))
    ticks = values["ngear"][0] * values["encRes"][0]
    if not isfinite(ticks):
        raise _unusable_description(folder, "a turn has infinitely many ticks")
    nominal = Geometry(values["Di"][0], values["Di"][-1], values["Li"][0])
    side = values["L"][0] if "L" in values else None
    return OptiodomSession(folder.name, nominal, side, [read_run(path, ticks) for path in paths])


def read_run(path: Path, ticks_per_turn: float) -> RecordedDrive:
    """One run file. Raises UsageError for an unusable one."""
    table = read_table(path)
    if table.shape[1] != RUN_COLUMNS or len(table) < 2:
        raise _unreadable_run(path, f"{len(table)} rows of {table.shape[1]} columns")
    if not np.isfinite(table).all():
        raise _unreadable_run(path, "a cell is empty, or no finite number")
    fault = ticks_gap(table[:, 0])
    if fault is not None:
        raise unusable_log(path, fault)
    turns = np.cumsum(table[:, 4:], axis=0) / ticks_per_turn
    tick = 1 / ticks_per_turn
    rows = np.arange(len(table))
    return RecordedDrive(
        path.stem, table[:, 0], turns - turns[0], rows, table[:, 1:4], (tick, tick), MOTION_CAPTURE
    )


def _read_description(path: Path) -> dict[str, list[float]]:
    """The numbers of the description by name; other cells are left out."""
    try:
        with open_regular(path) as file:
            text = file.read(DESCRIPTION_MAX_BYTES).decode(CSV_ENCODING)
        rows = list(csv.reader(text.splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise _unusable_description(path, f"cannot be read: {error_text(error)}") from error
    values: dict[str, list[float]] = {}
    for name, *cells in filter(None, rows):
        for cell in cells:
            with suppress(ValueError):
                values.setdefault(name.strip(), []).append(float(cell))
    needed = ("ngear", "encRes", "Li", "Di")
    missing = [name for name in needed if name not in values]
    if missing:
        raise _unusable_description(path, f"{', '.join(missing)} missing")
    for name in needed:
        if not all(0.0 < value < inf for value in values[name]):
            raise _unusable_description(path, f"{name} is not above 0, or no finite number")
    return values


def _unusable_description(path: Path, cause: str) -> UsageError:
    fix = "a description states gear ratio (ngear), ticks a turn (encRes), track (Li), wheels (Di)"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), cause, fix))


def _unreadable_run(path: Path, cause: str) -> UsageError:
    fix = "a run has no header and six columns: time, x, y, heading, right ticks, left ticks"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), f"cannot be read: {cause}", fix))
