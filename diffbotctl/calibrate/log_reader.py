"""Recorded drives from recordings, CSV files and sessions of the OptiOdom data set.

OptiOdom: Sousa, Petry, Costa & Moreira, "OptiOdom: a Generic Approach for Odometry Calibration of
Wheeled Mobile Robots", J. Intelligent & Robotic Systems 105:39, 2022. A session is a folder with
`<session>_run-NN.csv` (no header: time s, x m, y m, heading rad, and the ticks of the right and
left wheel in the cycle) and `<session>_metadata.csv`. Ground truth is a motion capture system.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from contextlib import suppress
from hashlib import sha256
from math import hypot, isnan, nan, pi, radians
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.dead_reckoning import (
    MOTION_CAPTURE,
    TAPE_MEASURE,
    Floats,
    Geometry,
    GroundTruth,
    RecordedDrive,
)
from diffbotctl.errors import Problem, RunError, UsageError, join_words
from diffbotctl.messages import Encoders
from diffbotctl.recording.reader import RecordingReader

COUNT_COLUMNS = ("time", "right", "left")
POSE_COLUMNS = ("x", "y", "heading")
RUN_COLUMNS = 6
END_DISTANCE_RATIO_MAX = 1.5  # of the distance to what the wheels rolled
FINGERPRINT_DIGITS = 16
CSV_ENCODING = "utf-8-sig"  # spreadsheets write a byte-order mark


class CountLog(NamedTuple):
    """The counts of one drive, and poses if the same file contains them."""

    name: str
    times: Floats
    """(rows,): s, increasing"""
    turns: Floats
    """(rows, 2): turns of the right and left wheel since the first row"""
    tick: tuple[float, float]
    poses: Floats | None
    """(rows, 3): x, y in m and heading in rad, nan if unknown; None without such columns"""

    def drive(self, rows: NDArray[np.intp], poses: Floats, truth: GroundTruth) -> RecordedDrive:
        """The drive with true `poses` (n, 3) at these rows."""
        poses = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
        return RecordedDrive(self.name, self.times, self.turns, rows, poses, self.tick, truth)


def read_counts(path: Path, ticks: tuple[float, float]) -> CountLog:
    """Counts in the recording (.mcap) or CSV file at `path`.

    `ticks`: counts per turn of the right and left wheel. The first line of a CSV file names the
    columns: time (s), right and left (counts since the start, signed), optionally x, y (m) and
    heading (rad). Raises UsageError for an unusable file.
    """
    is_recording = path.suffix == ".mcap"
    table, poses = _read_recording(path) if is_recording else _read_csv(path)
    if len(table) < 2 or not np.isfinite(table).all() or (np.diff(table[:, 0]) <= 0).any():
        cause = "needs at least two rows, increasing times, and a count in every row"
        raise unusable_log(path, cause)
    turns = (table[:, 1:] - table[0, 1:]) / ticks
    tick = (1 / ticks[0], 1 / ticks[1])
    return CountLog(path.stem, table[:, 0] - table[0, 0], turns, tick, poses)


def with_own_poses(counts: CountLog) -> RecordedDrive:
    """The drive with the poses in its own file. Raises UsageError without any."""
    if counts.poses is not None:
        rows = np.flatnonzero(np.isfinite(counts.poses).all(axis=1))
        if len(rows) >= 2:
            return counts.drive(rows, counts.poses[rows], MOTION_CAPTURE)
    raise unusable_log(Path(counts.name), "contains no true poses; give --ends or --truth")


def with_end(counts: CountLog, end: Sequence[float]) -> RecordedDrive:
    """The drive from the origin along x to `end`: x, y in m, heading in rad or nan.

    Raises UsageError if x or y is nan.
    """
    if not np.isfinite(end[:2]).all():
        raise unusable_log(Path(counts.name), "its end pose has no x or y")
    rows = np.array([0, len(counts.times) - 1])
    return counts.drive(rows, np.array([[0.0, 0.0, 0.0], end]), TAPE_MEASURE)


def with_truth(counts: CountLog, path: Path) -> RecordedDrive:
    """The drive with the true poses of the CSV file at `path`: time (s since the start of the
    drive), x, y (m) and heading (rad). Raises UsageError if there are fewer than two.
    """
    truth = _parse_columns(path, _csv_rows(path, ("time", *POSE_COLUMNS)), ("time", *POSE_COLUMNS))
    times = truth[:, 0]
    truth = truth[(times >= 0) & (times <= counts.times[-1]) & np.isfinite(truth).all(axis=1)]
    if len(truth) < 2 or (np.diff(truth[:, 0]) <= 0).any():
        raise unusable_log(path, "needs at least two poses, at increasing times within the drive")
    times = np.union1d(counts.times, truth[:, 0])
    turns = [np.interp(times, counts.times, wheel) for wheel in counts.turns.T]
    joined = counts._replace(times=times, turns=np.stack(turns, axis=1))
    return joined.drive(np.searchsorted(times, truth[:, 0]), truth[:, 1:], MOTION_CAPTURE)


def refuse_too_far(counts: CountLog, end: Sequence[float], diameter: float, path: Path) -> None:
    """Raises UsageError if wheels of `diameter` (m) cannot have reached `end` (m) of `path`.

    The most common cause is a wrong unit.
    """
    rolled = pi * diameter * float(np.abs(np.diff(counts.turns, axis=0)).sum(axis=0).max())
    distance = hypot(end[0], end[1])
    if distance > END_DISTANCE_RATIO_MAX * rolled:
        cause = f"says that {counts.name} ended {distance:.4g} m from its start, but its wheels "
        raise unusable_log(path, f"{cause}rolled only {rolled:.3g} m; x and y are in metres")


def read_ends(path: Path) -> dict[str, tuple[float, float, float]]:
    """End poses by the name of the drive's file, without its suffix.

    Columns: recording, x and y (m), and heading (rad) or heading_deg, which may be empty. Raises
    UsageError.
    """
    ends = {}
    for row in _csv_rows(path, ("recording", "x", "y")):
        degrees = _parse_number(path, row.get("heading_deg"))
        heading = _parse_number(path, row.get("heading")) if isnan(degrees) else radians(degrees)
        x, y = (_parse_number(path, row[name]) for name in ("x", "y"))
        ends[Path(row["recording"].strip()).stem] = (x, y, heading)
    return ends


def fingerprint(paths: Sequence[Path]) -> str:
    """Hash (hexadecimal) of the contents of all files."""
    return sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:FINGERPRINT_DIGITS]


def unusable_log(path: Path, cause: str) -> UsageError:
    """The error for an unusable file."""
    fix = "`diffbotctl explain E-CALIBRATE-LOG` describes the files"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), cause, fix))


def _read_recording(path: Path) -> tuple[Floats, None]:
    try:
        messages = [item.message for item in RecordingReader(path).messages() if item.from_driver]
    except RunError as error:
        raise unusable_log(path, f"cannot be read: {error.problems[0].cause}") from error
    frames = [message for message in messages if isinstance(message, Encoders)]
    if len({frame.boot for frame in frames}) > 1:
        raise unusable_log(path, "the board and its counts restarted during this drive")
    return np.array([(frame.time / 1e9, frame.right, frame.left) for frame in frames]), None


def _read_csv(path: Path) -> tuple[Floats, Floats | None]:
    rows = _csv_rows(path, COUNT_COLUMNS)
    counts = _parse_columns(path, rows, COUNT_COLUMNS)
    if not rows or any(name not in rows[0] for name in POSE_COLUMNS):
        return counts, None
    return counts, _parse_columns(path, rows, POSE_COLUMNS)


def _csv_rows(path: Path, names: Sequence[str]) -> list[dict[str, str]]:
    """The rows of a CSV file by column name. Raises UsageError if one of `names` is missing."""
    try:
        reader = csv.DictReader(path.read_text(CSV_ENCODING).splitlines(), restval="")
    except (OSError, UnicodeDecodeError) as error:
        raise unusable_log(path, f"cannot be read: {error}") from error
    reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
    missing = [name for name in names if name not in reader.fieldnames]
    if missing:
        raise unusable_log(path, f"its first line does not name {join_words(missing, 'and')}")
    return list(reader)


def _parse_columns(path: Path, rows: list[dict[str, str]], names: Sequence[str]) -> Floats:
    """(rows, names)"""
    table = [[_parse_number(path, row[name]) for name in names] for row in rows]
    return np.array(table).reshape(-1, len(names))


def _parse_number(path: Path, text: str | None) -> float:
    """The number in a cell; nan for an empty one."""
    try:
        return float(text) if text and text.strip() else nan
    except ValueError:
        raise unusable_log(path, f"'{text}' is not a number") from None


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
    nominal = Geometry(values["Di"][0], values["Di"][-1], values["Li"][0])
    side = values["L"][0] if "L" in values else None
    return OptiodomSession(folder.name, nominal, side, [read_run(path, ticks) for path in paths])


def read_run(path: Path, ticks_per_turn: float) -> RecordedDrive:
    """One run file. Raises UsageError for an unusable one."""
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
    """The numbers of the description by name; other cells are left out."""
    try:
        rows = list(csv.reader(path.read_text(CSV_ENCODING).splitlines()))
    except OSError as error:
        raise _unreadable_run(path, str(error)) from error
    values: dict[str, list[float]] = {}
    for name, *cells in filter(None, rows):
        for cell in cells:
            with suppress(ValueError):
                values.setdefault(name.strip(), []).append(float(cell))
    missing = [name for name in ("ngear", "encRes", "Li", "Di") if name not in values]
    if missing:
        raise _unreadable_run(path, f"{', '.join(missing)} missing")
    return values


def _unreadable_run(path: Path, cause: str) -> UsageError:
    fix = "a run has no header and six columns: time, x, y, heading, right ticks, left ticks"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), f"cannot be read: {cause}", fix))
