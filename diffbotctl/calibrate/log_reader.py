"""Reads counts from a recording or a CSV file, and joins them with poses that were measured."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from hashlib import sha256
from math import hypot, pi, radians
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.recorded_drive import CAMERAS, TAPE, Floats, RecordedDrive
from diffbotctl.errors import Problem, UsageError, join_words

COUNTS = ("time", "right", "left")
POSE = ("x", "y", "heading")
FAR = 1.5  # times what the wheels rolled; none is half as large again as the file states
FINGERPRINT = 16  # hexadecimal digits
MARKED = "utf-8-sig"  # spreadsheets begin their files with a byte-order mark


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
        raise unusable(path, "needs two rows or more, times that rise, and a count in every row")
    turns = (table[:, 1:] - table[0, 1:]) / ticks
    tick = (1 / ticks[0], 1 / ticks[1])
    return CountLog(path.stem, table[:, 0] - table[0, 0], turns, tick, poses)


def with_own_poses(counts: CountLog) -> RecordedDrive:
    """The drive, with the poses that stand beside its counts. Raises UsageError without any."""
    known = np.isfinite(counts.poses).all(axis=1) if counts.poses is not None else np.zeros(0)
    rows = np.flatnonzero(known)
    if counts.poses is None or len(rows) < 2:
        raise unusable(Path(counts.name), "tells no true poses; give --ends or --truth")
    poses = _unwrapped(counts.poses[rows])
    return RecordedDrive(counts.name, counts.times, counts.turns, rows, poses, counts.tick, CAMERAS)


def with_end(counts: CountLog, end: Sequence[float]) -> RecordedDrive:
    """The drive, begun at the origin along x and ended at `end`: x, y in m, heading in rad or nan.

    Raises UsageError when x or y is nan.
    """
    if not np.isfinite(end[:2]).all():
        raise unusable(Path(counts.name), "its end pose lacks x or y")
    rows = np.array([0, len(counts.times) - 1])
    poses = np.array([[0.0, 0.0, 0.0], end])
    return RecordedDrive(counts.name, counts.times, counts.turns, rows, poses, counts.tick, TAPE)


def refuse_too_far(counts: CountLog, end: Sequence[float], diameter: float, path: Path) -> None:
    """Raises UsageError for an `end` (m) of `path` that wheels of `diameter` (m) cannot have met.

    Nothing is as often wrong with a tape's figures as their unit.
    """
    rolled = pi * diameter * float(np.abs(np.diff(counts.turns, axis=0)).sum(axis=0).max())
    away = hypot(end[0], end[1])
    if away > FAR * rolled:
        cause = f"has {counts.name} end {away:.4g} m from its start, but its wheels rolled "
        raise unusable(path, f"{cause}{rolled:.3g} m; x and y are in metres")


def with_truth(counts: CountLog, path: Path) -> RecordedDrive:
    """The drive, with the true poses of the CSV file at `path`: time since its start,
    x, y and heading. Raises UsageError when it is none, or tells of another time.
    """
    truth = _columns(path, ("time", *POSE))
    inside = (truth[:, 0] >= 0) & (truth[:, 0] <= counts.times[-1]) & np.isfinite(truth).all(axis=1)
    truth = truth[inside]
    if len(truth) < 2 or (np.diff(truth[:, 0]) <= 0).any():
        raise unusable(path, "needs two poses or more, at rising times within the drive")
    times = np.union1d(counts.times, truth[:, 0])
    turns = [np.interp(times, counts.times, wheel) for wheel in counts.turns.T]
    rows = np.searchsorted(times, truth[:, 0])
    poses = _unwrapped(truth[:, 1:])
    return RecordedDrive(
        counts.name, times, np.stack(turns, axis=1), rows, poses, counts.tick, CAMERAS
    )


def read_ends(path: Path) -> dict[str, tuple[float, float, float]]:
    """End poses by the name of the drive's file, without its suffix.

    Columns: recording, x and y (m), and heading (rad) or heading_deg; a heading may be left empty.
    Raises UsageError.
    """
    rows = _rows(path, ("recording", "x", "y"))
    found = {}
    for row in rows:
        degrees = row.get("heading_deg", "").strip()
        heading = radians(_number(path, degrees)) if degrees else _number(path, row.get("heading"))
        pose = (_number(path, row["x"]), _number(path, row["y"]), heading)
        found[Path(row["recording"].strip()).stem] = pose
    return found


def fingerprint(paths: Sequence[Path]) -> str:
    """Hash (hexadecimal) of the contents of all files."""
    return sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:FINGERPRINT]


def unusable(path: Path, cause: str) -> UsageError:
    """What to raise for a file that cannot serve."""
    fix = "`diffbotctl explain E-CALIBRATE-LOG` tells what the files look like"
    return UsageError(Problem("E-CALIBRATE-LOG", str(path), cause, fix))


def _from_recording(path: Path) -> tuple[Floats, None]:
    from diffbotctl.messages import Encoders
    from diffbotctl.recording.mcap_file import RecordingReader

    try:
        messages = [each.message for each in RecordingReader(path).messages() if each.from_driver]
    except OSError as error:
        raise unusable(path, f"cannot be read: {error.strerror}") from error
    encoders = [each for each in messages if isinstance(each, Encoders)]
    if len({each.boot for each in encoders}) > 1:
        raise unusable(path, "the board restarted during this drive, and its counts with it")
    return np.array([(each.time / 1e9, each.right, each.left) for each in encoders]), None


def _from_csv(path: Path) -> tuple[Floats, Floats | None]:
    rows = _rows(path, COUNTS)
    counts = np.array([[_number(path, row[name]) for name in COUNTS] for row in rows])
    if not rows or any(name not in rows[0] for name in POSE):
        return counts, None
    return counts, np.array([[_number(path, row[name]) for name in POSE] for row in rows])


def _columns(path: Path, names: Sequence[str]) -> Floats:
    return np.array([[_number(path, row[name]) for name in names] for row in _rows(path, names)])


def _rows(path: Path, names: Sequence[str]) -> list[Mapping[str, str]]:
    """The lines of a CSV file, each by the names of its first line; all of `names` are there."""
    try:
        reader = csv.DictReader(path.read_text(MARKED).splitlines(), restval="")
    except (OSError, UnicodeDecodeError) as error:
        raise unusable(path, f"cannot be read: {error}") from error
    reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
    missing = [name for name in names if name not in reader.fieldnames]
    if missing:
        raise unusable(path, f"its first line does not name {join_words(missing, 'and')}")
    return list(reader)


def _number(path: Path, text: str | None) -> float:
    """The number in a cell; nan for an empty one."""
    try:
        return float(text) if text and text.strip() else float("nan")
    except ValueError:
        raise unusable(path, f"'{text}' is not a number") from None


def _unwrapped(poses: Floats) -> Floats:
    return np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
