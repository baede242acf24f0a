"""Reads counts from a recording or a CSV file, and joins them with poses that were measured.

Reads sessions of the OptiOdom data set, and tells what their ends came to.

Sousa, Petry, Costa & Moreira, "OptiOdom: a Generic Approach for Odometry Calibration of Wheeled
Mobile Robots", J. Intelligent & Robotic Systems 105:39, 2022. A session is a folder of
`<session>_run-NN.csv` (no header: time s, x m, y m, heading rad, and the right and left wheel's
ticks of the cycle) beside `<session>_metadata.csv`. Ground truth is a motion capture system.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from hashlib import sha256
from math import hypot, pi, radians
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import (
    MOTION_CAPTURE,
    TAPE_MEASURE,
    Floats,
    Geometry,
    RecordedDrive,
)
from diffbotctl.errors import Problem, RunError, UsageError, join_words

COUNT_COLUMNS = ("time", "right", "left")
POSE_COLUMNS = ("x", "y", "heading")
END_DISTANCE_RATIO_MAX = (
    1.5  # times what the wheels rolled; none is half as large again as the file states
)
FINGERPRINT_DIGITS = 16  # hexadecimal digits
CSV_ENCODING = "utf-8-sig"  # spreadsheets begin their files with a byte-order mark


class CountLog(NamedTuple):
    """What the wheels counted on one drive, and poses where the same file tells them."""

    name: str
    times: Floats
    """(rows,): s, rising"""
    turns: Floats
    """(rows, 2): turns of the right and left wheel since the first row"""
    tick: tuple[float, float]
    poses: Floats | None
    """(rows, 3): x, y in m and heading in rad; nan where unknown; None: the file has no such
    columns"""


def read_counts(path: Path, ticks: tuple[float, float]) -> CountLog:
    """Counts in the recording (.mcap) or CSV file at `path`.

    `ticks`: counts per turn of the right and left wheel. A CSV file has a line of names: time (s),
    right and left (counts since the start, backward is less), and x, y (m), heading (rad) if known.
    Raises UsageError for a file that cannot serve.
    """
    recorded = path.suffix == ".mcap"
    table, poses = _from_recording(path) if recorded else _from_csv(path)
    if len(table) < 2 or not np.isfinite(table).all() or (np.diff(table[:, 0]) <= 0).any():
        raise unusable_log(
            path, "needs two rows or more, times that rise, and a count in every row"
        )
    turns = (table[:, 1:] - table[0, 1:]) / ticks
    tick = (1 / ticks[0], 1 / ticks[1])
    return CountLog(path.stem, table[:, 0] - table[0, 0], turns, tick, poses)


def with_own_poses(counts: CountLog) -> RecordedDrive:
    """The drive, with the poses that stand beside its counts. Raises UsageError without any."""
    known = np.isfinite(counts.poses).all(axis=1) if counts.poses is not None else np.zeros(0)
    rows = np.flatnonzero(known)
    if counts.poses is None or len(rows) < 2:
        raise unusable_log(Path(counts.name), "tells no true poses; give --ends or --truth")
    poses = _unwrapped(counts.poses[rows])
    return RecordedDrive(
        counts.name, counts.times, counts.turns, rows, poses, counts.tick, MOTION_CAPTURE
    )


def with_end(counts: CountLog, end: Sequence[float]) -> RecordedDrive:
    """The drive, begun at the origin along x and ended at `end`: x, y in m, heading in rad or nan.

    Raises UsageError when x or y is nan.
    """
    if not np.isfinite(end[:2]).all():
        raise unusable_log(Path(counts.name), "its end pose lacks x or y")
    rows = np.array([0, len(counts.times) - 1])
    poses = np.array([[0.0, 0.0, 0.0], end])
    return RecordedDrive(
        counts.name, counts.times, counts.turns, rows, poses, counts.tick, TAPE_MEASURE
    )


def refuse_too_far(counts: CountLog, end: Sequence[float], diameter: float, path: Path) -> None:
    """Raises UsageError for an `end` (m) of `path` that wheels of `diameter` (m) cannot have met.

    Nothing is as often wrong with a tape's figures as their unit.
    """
    rolled = pi * diameter * float(np.abs(np.diff(counts.turns, axis=0)).sum(axis=0).max())
    away = hypot(end[0], end[1])
    if away > END_DISTANCE_RATIO_MAX * rolled:
        cause = f"has {counts.name} end {away:.4g} m from its start, but its wheels rolled "
        raise unusable_log(path, f"{cause}{rolled:.3g} m; x and y are in metres")


def with_truth(counts: CountLog, path: Path) -> RecordedDrive:
    """The drive, with the true poses of the CSV file at `path`: time since its start,
    x, y and heading. Raises UsageError when it is none, or tells of another time.
    """
    truth = _csv_columns(path, ("time", *POSE_COLUMNS))
    inside = (truth[:, 0] >= 0) & (truth[:, 0] <= counts.times[-1]) & np.isfinite(truth).all(axis=1)
    truth = truth[inside]
    if len(truth) < 2 or (np.diff(truth[:, 0]) <= 0).any():
        raise unusable_log(path, "needs two poses or more, at rising times within the drive")
    times = np.union1d(counts.times, truth[:, 0])
    turns = [np.interp(times, counts.times, wheel) for wheel in counts.turns.T]
    rows = np.searchsorted(times, truth[:, 0])
    poses = _unwrapped(truth[:, 1:])
    return RecordedDrive(
        counts.name, times, np.stack(turns, axis=1), rows, poses, counts.tick, MOTION_CAPTURE
    )


def read_ends(path: Path) -> dict[str, tuple[float, float, float]]:
    """End poses by the name of the drive's file, without its suffix.

    Columns: recording, x and y (m), and heading (rad) or heading_deg; a heading may be left empty.
    Raises UsageError.
    """
    rows = _csv_rows(path, ("recording", "x", "y"))
    found = {}
    for row in rows:
        degrees = row.get("heading_deg", "").strip()
        heading = (
            radians(_parse_number(path, degrees))
            if degrees
            else _parse_number(path, row.get("heading"))
        )
        pose = (_parse_number(path, row["x"]), _parse_number(path, row["y"]), heading)
        found[Path(row["recording"].strip()).stem] = pose
    return found


def fingerprint(paths: Sequence[Path]) -> str:
    """Hash (hexadecimal) of the contents of all files."""
    return sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:FINGERPRINT_DIGITS]


def unusable_log(path: Path, cause: str) -> UsageError:
    """What to raise for a file that cannot serve."""
    fix = "`diffbotctl explain E-CALIBRATE-LOG` tells what the files look like"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), cause, fix))


def _from_recording(path: Path) -> tuple[Floats, None]:
    from diffbotctl.messages import Encoders
    from diffbotctl.recording.reader import RecordingReader

    try:
        messages = [each.message for each in RecordingReader(path).messages() if each.from_driver]
    except RunError as error:
        raise unusable_log(path, f"cannot be read: {error.problems[0].cause}") from error
    encoders = [each for each in messages if isinstance(each, Encoders)]
    if len({each.boot for each in encoders}) > 1:
        raise unusable_log(path, "the board restarted during this drive, and its counts with it")
    return np.array([(each.time / 1e9, each.right, each.left) for each in encoders]), None


def _from_csv(path: Path) -> tuple[Floats, Floats | None]:
    rows = _csv_rows(path, COUNT_COLUMNS)
    counts = np.array([[_parse_number(path, row[name]) for name in COUNT_COLUMNS] for row in rows])
    if not rows or any(name not in rows[0] for name in POSE_COLUMNS):
        return counts, None
    return counts, np.array(
        [[_parse_number(path, row[name]) for name in POSE_COLUMNS] for row in rows]
    )


def _csv_columns(path: Path, names: Sequence[str]) -> Floats:
    return np.array(
        [[_parse_number(path, row[name]) for name in names] for row in _csv_rows(path, names)]
    )


def _csv_rows(path: Path, names: Sequence[str]) -> list[Mapping[str, str]]:
    """The lines of a CSV file, each by the names of its first line; all of `names` are there."""
    try:
        reader = csv.DictReader(path.read_text(CSV_ENCODING).splitlines(), restval="")
    except (OSError, UnicodeDecodeError) as error:
        raise unusable_log(path, f"cannot be read: {error}") from error
    reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
    missing = [name for name in names if name not in reader.fieldnames]
    if missing:
        raise unusable_log(path, f"its first line does not name {join_words(missing, 'and')}")
    return list(reader)


def _parse_number(path: Path, text: str | None) -> float:
    """The number in a cell; nan for an empty one."""
    try:
        return float(text) if text and text.strip() else float("nan")
    except ValueError:
        raise unusable_log(path, f"'{text}' is not a number") from None


def _unwrapped(poses: Floats) -> Floats:
    return np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])


RUN_COLUMNS = 6


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
    about = _read_description(next(iter(folder.glob("*_metadata.csv")), folder / "metadata.csv"))
    ticks = about["ngear"][0] * about["encRes"][0]
    wheels = about["Di"]
    nominal = Geometry(wheels[0], wheels[-1], about["Li"][0])
    side = about["L"][0] if "L" in about else None
    return OptiodomSession(folder.name, nominal, side, [read_run(path, ticks) for path in paths])


def read_run(path: Path, ticks_per_turn: float) -> RecordedDrive:
    """One run file. Raises UsageError when it is none."""
    try:
        table = np.loadtxt(path, delimiter=",", encoding=CSV_ENCODING, ndmin=2)
    except (OSError, ValueError) as error:
        raise _unreadable_run(path, str(error)) from error
    if table.shape[1] != RUN_COLUMNS or len(table) < 2:
        raise _unreadable_run(path, f"{len(table)} rows of {table.shape[1]} columns")
    turns = np.cumsum(table[:, 4:], axis=0) / ticks_per_turn
    tick = 1 / ticks_per_turn
    rows = np.arange(len(table))
    return RecordedDrive(
        path.stem, table[:, 0], turns - turns[0], rows, table[:, 1:4], (tick, tick), MOTION_CAPTURE
    )


def _read_description(path: Path) -> dict[str, list[float]]:
    """Numbers of the description by name; what is no number is left out."""
    try:
        rows = list(csv.reader(path.read_text(CSV_ENCODING).splitlines()))
    except OSError as error:
        raise _unreadable_run(path, str(error)) from error
    found = {row[0].strip(): _parse_numbers(row[1:]) for row in rows if row}
    missing = [name for name in ("ngear", "encRes", "Li", "Di") if not found.get(name)]
    if missing:
        raise _unreadable_run(path, f"does not tell {', '.join(missing)}")
    return {name: numbers for name, numbers in found.items() if numbers}


def _parse_numbers(cells: list[str]) -> list[float]:
    numbers = []
    for cell in cells:
        try:
            numbers.append(float(cell))
        except ValueError:
            continue
    return numbers


def _unreadable_run(path: Path, cause: str) -> UsageError:
    fix = "a run has no header and six columns: time, x, y, heading, right ticks, left ticks"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), f"cannot be read: {cause}", fix))
