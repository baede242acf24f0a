"""Reads sessions of the OptiOdom data set, and tells what their ends came to.

Sousa, Petry, Costa & Moreira, "OptiOdom: a Generic Approach for Odometry Calibration of Wheeled
Mobile Robots", J. Intelligent & Robotic Systems 105:39, 2022. A session is a folder of
`<session>_run-NN.csv` (no header: time s, x m, y m, heading rad, and the right and left wheel's
ticks of the cycle) beside `<session>_metadata.csv`. Ground truth is a motion capture system.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.geometry import Geometry
from diffbotctl.calibrate.recorded_drive import CAMERAS, RecordedDrive
from diffbotctl.errors import Problem, UsageError

COLUMNS = 6
MARKED = "utf-8-sig"  # some files begin with a byte-order mark


class OptiodomSession(NamedTuple):
    """One folder."""

    name: str
    nominal: Geometry
    side: float | None
    """m; of the squares, None when there are none"""
    drives: list[RecordedDrive]


def is_session(folder: Path) -> bool:
    """Whether `folder` holds run files with a description beside them."""
    return any(folder.glob("*_metadata.csv")) and any(folder.glob("*_run-*.csv"))


def read_session(folder: Path) -> OptiodomSession:
    """The session in `folder`. Raises UsageError for one that lacks something."""
    paths = sorted(folder.glob("*_run-*.csv"))
    if not paths:
        cause = "holds no *_run-*.csv files"
        raise UsageError(Problem("E-CALIBRATE-LOG", str(folder), cause, "name a session's folder"))
    about = _description(next(iter(folder.glob("*_metadata.csv")), folder / "metadata.csv"))
    ticks = about["ngear"][0] * about["encRes"][0]
    wheels = about["Di"]
    nominal = Geometry(wheels[0], wheels[-1], about["Li"][0])
    side = about["L"][0] if "L" in about else None
    return OptiodomSession(folder.name, nominal, side, [read_run(path, ticks) for path in paths])


def read_run(path: Path, ticks_per_turn: float) -> RecordedDrive:
    """One run file. Raises UsageError when it is none."""
    try:
        table = np.loadtxt(path, delimiter=",", encoding=MARKED, ndmin=2)
    except (OSError, ValueError) as error:
        raise _unreadable(path, str(error)) from error
    if table.shape[1] != COLUMNS or len(table) < 2:
        raise _unreadable(path, f"{len(table)} rows of {table.shape[1]} columns")
    turns = np.cumsum(table[:, 4:], axis=0) / ticks_per_turn
    tick = 1 / ticks_per_turn
    rows = np.arange(len(table))
    return RecordedDrive(
        path.stem, table[:, 0], turns - turns[0], rows, table[:, 1:4], (tick, tick), CAMERAS
    )


def _description(path: Path) -> dict[str, list[float]]:
    """Numbers of the description by name; what is no number is left out."""
    try:
        rows = list(csv.reader(path.read_text(MARKED).splitlines()))
    except OSError as error:
        raise _unreadable(path, str(error)) from error
    found = {row[0].strip(): _numbers(row[1:]) for row in rows if row}
    missing = [name for name in ("ngear", "encRes", "Li", "Di") if not found.get(name)]
    if missing:
        raise _unreadable(path, f"does not tell {', '.join(missing)}")
    return {name: numbers for name, numbers in found.items() if numbers}


def _numbers(cells: list[str]) -> list[float]:
    numbers = []
    for cell in cells:
        try:
            numbers.append(float(cell))
        except ValueError:
            continue
    return numbers


def _unreadable(path: Path, cause: str) -> UsageError:
    fix = "a run has no header and six columns: time, x, y, heading, right ticks, left ticks"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), f"cannot be read: {cause}", fix))
