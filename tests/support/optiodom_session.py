"""Sessions of the OptiOdom data set.

OptiOdom: Sousa, Petry, Costa & Moreira, "OptiOdom: a Generic Approach for Odometry Calibration of
Wheeled Mobile Robots", J. Intelligent & Robotic Systems 105:39, 2022. A session is a folder with
`<session>_run-NN.csv` (no header: time s, x m, y m, heading rad, and the ticks of the right and
left wheel in the cycle) and `<session>_metadata.csv`. Ground truth is a motion capture system.
"""

from __future__ import annotations

import csv
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import MOTION_CAPTURE, Floats, Geometry, RecordedDrive
from diffbotctl.calibrate.geometry_fit import GeometryFit, fit_geometry
from diffbotctl.calibrate.log_reader import refuse_unusable

ROWS_MIN = 20  # of a drive; fewer show no usual period
GAP_TIME_RATIO_MIN = 1.8  # one row of ticks is missing


class OptiodomSession(NamedTuple):
    """One folder."""

    name: str
    nominal: Geometry
    side: float | None
    """m, of the squares; None if there are none"""
    drives: list[RecordedDrive]

    def fit(self) -> GeometryFit:
        """The geometry of its drives, as `from-log` finds it. Raises UsageError or ValueError."""
        refuse_unusable(self.drives)
        return fit_geometry(self.drives, self.nominal)


def is_session(folder: Path) -> bool:
    """Whether `folder` contains run files and their description."""
    return any(folder.glob("*_metadata.csv")) and any(folder.glob("*_run-*.csv"))


def read_session(folder: Path) -> OptiodomSession:
    """The session in `folder`. Raises ValueError for a run in which rows are missing."""
    values = _read_description(next(iter(folder.glob("*_metadata.csv"))))
    ticks = values["ngear"][0] * values["encRes"][0]
    nominal = Geometry(values["Di"][0], values["Di"][-1], values["Li"][0])
    side = values["L"][0] if "L" in values else None
    drives = [_read_run(path, ticks) for path in sorted(folder.glob("*_run-*.csv"))]
    return OptiodomSession(folder.name, nominal, side, drives)


def _read_run(path: Path, ticks_per_turn: float) -> RecordedDrive:
    table = np.loadtxt(path, delimiter=",", encoding="utf-8-sig", ndmin=2)
    times, poses = table[:, 0], table[:, 1:4]
    _refuse_gap(path, times)
    turns = np.cumsum(table[:, 4:6], axis=0) / ticks_per_turn
    tick = 1 / ticks_per_turn
    rows = np.arange(len(table))
    return RecordedDrive(
        path.stem, times, turns - turns[0], rows, poses, (tick, tick), MOTION_CAPTURE
    )


def _refuse_gap(path: Path, times: Floats) -> None:
    """Raises ValueError where rows of ticks are missing: the motion in them is lost."""
    steps = np.diff(times)
    if len(times) >= ROWS_MIN and steps.max() >= GAP_TIME_RATIO_MIN * float(np.median(steps)):
        raise ValueError(f"{path.name}: rows are missing after {times[np.argmax(steps)]:.2f} s")


def _read_description(path: Path) -> dict[str, list[float]]:
    """The numbers of the description by name; other cells are left out."""
    values: dict[str, list[float]] = {}
    with path.open(encoding="utf-8-sig") as file:
        for name, *cells in filter(None, csv.reader(file)):
            for cell in cells:
                with suppress(ValueError):
                    values.setdefault(name.strip(), []).append(float(cell))
    return values
