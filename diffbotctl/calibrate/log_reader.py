"""Recorded drives from recordings and CSV files."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from math import pi
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.csv_table import column_names, error_text, read_columns, unusable_log
from diffbotctl.calibrate.dead_reckoning import (
    MOTION_CAPTURE,
    TAPE_MEASURE,
    Floats,
    GroundTruth,
    RecordedDrive,
)
from diffbotctl.calibrate.log_checks import count_fault, encoder_fault, table_fault
from diffbotctl.calibrate.recorded_frames import TICK_RATIO, estimated_turns, read_frames
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_ports import VIRTUAL_PORTS
from diffbotctl.messages import Encoders
from diffbotctl.recording.reader import RecordingReader

COUNT_COLUMNS = ("time", "right", "left")
SIMULATED_COLUMN = "simulated"  # its name alone marks the counts of a simulated robot
POSE_COLUMNS = ("x", "y", "heading")
DEGREES = "heading_deg"
HEADING_MAX_RAD = 100 * 2 * pi
SAME_TIME_DIGITS = 3  # of s
DURATION_RATIO_MAX = 20.0  # of the poses to the counts
FINGERPRINT_DIGITS = 16
WRAPPED_HEADING_MAX_RAD = 6.4  # a little more than one turn


class CountLog(NamedTuple):
    """The counts of one drive, and poses if the same file contains them."""

    name: str
    times: Floats  # (rows,): s, increasing
    turns: Floats  # (rows, 2): turns of the right and left wheel since the first row
    tick: tuple[float, float]
    poses: Floats | None
    """(rows, 3): x, y in m and heading in rad, nan if unknown; None without such columns"""

    def drive(self, rows: NDArray[np.intp], poses: Floats, truth: GroundTruth) -> RecordedDrive:
        """The drive with true `poses` (n, 3) at these rows."""
        # Headings beyond one turn are unwrapped already, or in degrees: both are kept.
        if len(poses) > 2 and np.abs(poses[:, 2]).max() <= WRAPPED_HEADING_MAX_RAD:
            poses = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
        return RecordedDrive(self.name, self.times, self.turns, rows, poses, self.tick, truth)


def read_counts(path: Path, ticks: tuple[float, float], robot: Robot | None = None) -> CountLog:
    """Counts in the recording (.mcap) or CSV file at `path`.

    `ticks`: counts per turn of the right and left wheel. `robot`: of a recording, to estimate the
    turns from the times of the edges too. The first line of a CSV file names the columns: time (s),
    right and left (counts since the start, signed), optionally x, y (m) and heading (rad) or
    heading_deg. Raises UsageError for an unusable file.
    """
    frames: list[Encoders] = []
    poses = None
    if path.suffix == ".mcap":
        frames = read_frames(path, robot)
        table = np.array([(frame.time / 1e9, frame.right, frame.left) for frame in frames])
    else:
        table = read_columns(path, COUNT_COLUMNS)
        if column_names(path).issuperset(POSE_COLUMNS[:2]):
            poses = _read_poses(path)
    fault = table_fault(table)
    if fault is not None:
        raise unusable_log(path, fault)
    times, counts = table[:, 0] - table[0, 0], table[:, 1:] - table[0, 1:]
    fault = count_fault(times, counts)
    if fault is not None:
        raise unusable_log(path, fault)
    tick = (1 / ticks[0], 1 / ticks[1])
    if frames and robot is not None:
        turns = estimated_turns(frames, robot)
        return CountLog(
            path.stem, times, turns, (TICK_RATIO * tick[0], TICK_RATIO * tick[1]), poses
        )
    return CountLog(path.stem, times, counts / ticks, tick, poses)


def with_own_poses(counts: CountLog) -> RecordedDrive:
    """The drive with the poses in its own file. Raises UsageError without any."""
    if counts.poses is not None:
        rows = np.flatnonzero(np.isfinite(counts.poses).all(axis=1))
        rows = rows[_is_new(counts.poses[rows])]
        if len(rows) >= 2:
            return counts.drive(rows, counts.poses[rows], MOTION_CAPTURE)
    raise unusable_log(
        Path(counts.name), "has no poses in columns x, y and heading; give --ends or --truth"
    )


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
    drive), x, y (m) and heading (rad) or heading_deg. Raises UsageError if there are fewer than
    two.
    """
    truth = _read_poses(path, ("time",))
    truth = truth[np.isfinite(truth).all(axis=1)]
    times = truth[:, 0]
    _refuse_other_unit(times, counts, path)
    truth = truth[(times >= 0) & (times <= counts.times[-1])]
    if len(truth) < 2 or (np.diff(truth[:, 0]) <= 0).any():
        cause = "needs at least two poses, at increasing times within the drive"
        raise unusable_log(path, cause, "write times in seconds since the start of the drive")
    truth = truth[_is_new(truth[:, 1:])]
    if len(truth) < 2:
        raise unusable_log(path, "all its poses are the same")
    times = np.union1d(counts.times, truth[:, 0])
    turns = [np.interp(times, counts.times, wheel) for wheel in counts.turns.T]
    joined = counts._replace(times=times, turns=np.stack(turns, axis=1))
    return joined.drive(np.searchsorted(times, truth[:, 0]), truth[:, 1:], MOTION_CAPTURE)


def _refuse_other_unit(times: Floats, counts: CountLog, path: Path) -> None:
    """Raises UsageError if the poses last much longer than the counts, or much shorter."""
    if len(times) < 2:
        return
    seconds, counted = float(np.ptp(times)), float(np.ptp(counts.times))
    if not 1 / DURATION_RATIO_MAX < seconds / counted < DURATION_RATIO_MAX:
        cause = f"its poses last {seconds:.4g} s, but the counts of {counts.name} {counted:.4g} s"
        raise unusable_log(path, cause, "write both times in seconds")


def _read_poses(path: Path, leading: tuple[str, ...] = ()) -> Floats:
    """(rows, columns): the columns `leading`, x and y in m, and the heading in rad."""
    is_degrees = DEGREES in column_names(path)
    if is_degrees and POSE_COLUMNS[2] in column_names(path):
        cause = f"its first line names heading and {DEGREES}"
        raise unusable_log(path, cause, "remove the column that is not meant")
    heading = DEGREES if is_degrees else POSE_COLUMNS[2]
    table = read_columns(path, (*leading, *POSE_COLUMNS[:2], heading))
    if is_degrees:
        table[:, -1] = np.radians(table[:, -1])
    bad = np.flatnonzero(np.abs(table[:, -1]) > HEADING_MAX_RAD)
    if len(bad):
        raise unusable_log(path, f"row {bad[0] + 1} states a heading of more than 100 turns")
    return table


def _is_new(poses: Floats) -> NDArray[np.bool_]:
    """(poses,): whether each of the poses (poses, 3) differs from the one before.

    Poses of a slow camera, or of one that lost the robot, are often repeated until the next one:
    then the time of the first alone is right.
    """
    return np.append(True, (np.diff(poses, axis=0) != 0.0).any(axis=1))


def refuse_unusable(drives: Sequence[CountLog | RecordedDrive]) -> None:
    """Raises UsageError for a drive in which an encoder did not count, or that is given twice.

    A copy would count as a second measurement, and one name stands for one end.
    """
    for number, drive in enumerate(drives):
        fault = encoder_fault(drive.turns / drive.tick)
        if fault is not None:
            fix = "run `diffbotctl calibrate encoders`, and record the drive again"
            raise unusable_log(Path(drive.name), fault, fix)
        for other in drives[:number]:
            if drive.name == other.name:
                cause = "two of the files have this name: give each file once, or rename one"
                raise unusable_log(Path(drive.name), cause)
            if _is_same(drive, other):
                cause = f"contains the same drive as {other.name}: give one"
                raise unusable_log(Path(drive.name), cause)


def _is_same(drive: CountLog | RecordedDrive, other: CountLog | RecordedDrive) -> bool:
    """Whether both have the same rows, by whichever clock."""
    rows = [
        np.column_stack([np.round(each.times - each.times[0], SAME_TIME_DIGITS), each.turns])
        for each in (drive, other)
    ]
    return np.array_equal(rows[0], rows[1])


def is_simulated(path: Path) -> bool:
    """Whether the drive in the readable file at `path` is of a simulated robot."""
    if path.suffix != ".mcap":
        return SIMULATED_COLUMN in column_names(path)
    reader = RecordingReader(path)
    next(reader.records(), None)
    return reader.about.get("port") in VIRTUAL_PORTS or "simulated" in reader.about


def fingerprint(paths: Sequence[Path]) -> str:
    """Hash (hexadecimal) of the contents of all files. Raises UsageError."""
    digest = sha256()
    for path in paths:
        try:
            digest.update(path.read_bytes())
        except OSError as error:
            raise unusable_log(path, f"cannot be read: {error_text(error)}") from error
    return digest.hexdigest()[:FINGERPRINT_DIGITS]
