"""Alignment of two clocks: that of the counts and that of the true poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry, RecordedDrive

CLOCK_OFFSET_MAX_S = 0.3  # larger ones are mistakes in the files
CLOCK_OFFSET_STEP_S = 0.005  # at 1 rad/s a third of a degree
CLOCK_OFFSET_POSES_MIN = 40  # in one drive
CLOCK_OFFSET_POSES_MAX = 4000  # of a long drive; the first ones are sufficient
MOVING_MEAN_PERIOD_S = 2.0  # shorter than most drift, longer than a turn
POSE_PERIOD_MAX_S = 0.2  # at longer periods, chords between poses hide the offset
MISMATCH_RATIO_MAX = 0.98  # after over before; above, the robot hardly turned
OTHER_CLOCK_MAX_S = 5.0
OTHER_CLOCK_STEP_S = 0.02
OTHER_CLOCK_RATIO_MAX = 0.5  # of the mismatch to that of the best offset that is no mistake
OTHER_CLOCK_TURN_RATIO_MAX = 0.3  # of the mismatch to the turns of the robot
TURNS_SD_MIN_RAD = 0.05  # of the headings around their moving mean; a straight drive has less


def clock_offset(drive: RecordedDrive, geometry: Geometry) -> float:
    """The delay (s) of the counts that fits the true headings best; 0 if it cannot be seen."""
    step = CLOCK_OFFSET_STEP_S
    offsets = np.arange(-CLOCK_OFFSET_MAX_S, CLOCK_OFFSET_MAX_S + step / 2, step)
    mismatches = _mismatches(drive, geometry, offsets)
    if mismatches is None:
        return 0.0
    best = int(np.argmin(mismatches))
    limit = MISMATCH_RATIO_MAX * mismatches[len(offsets) // 2]
    return float(offsets[best]) if mismatches[best] < limit else 0.0


def other_clock(drive: RecordedDrive, geometry: Geometry) -> float | None:
    """The delay (s) of the counts if it is larger than two clocks of one recording differ; None if
    it is not, or cannot be seen."""
    step = OTHER_CLOCK_STEP_S
    offsets = np.arange(-OTHER_CLOCK_MAX_S, OTHER_CLOCK_MAX_S + step / 2, step)
    mismatches = _mismatches(drive, geometry, offsets)
    standing = replace(drive, turns=np.zeros_like(drive.turns))
    turns = _mismatches(standing, geometry, np.zeros(1))
    if mismatches is None or turns is None or turns[0] < TURNS_SD_MIN_RAD:
        return None
    best = int(np.argmin(mismatches))
    usual = mismatches[np.abs(offsets) <= CLOCK_OFFSET_MAX_S].min()
    limit = min(OTHER_CLOCK_RATIO_MAX * usual, OTHER_CLOCK_TURN_RATIO_MAX * turns[0])
    return float(offsets[best]) if mismatches[best] < limit else None


def _mismatches(drive: RecordedDrive, geometry: Geometry, offsets: Floats) -> Floats | None:
    """(offsets,): of the headings, in rad, if the counts are delayed by each of the offsets (s);
    None for too few poses."""
    if len(drive.rows) < CLOCK_OFFSET_POSES_MIN:
        return None
    rolled = drive.turns * np.pi * (geometry.right, geometry.left)
    headings = (rolled[:, 0] - rolled[:, 1]) / geometry.track
    poses = drive.poses[:CLOCK_OFFSET_POSES_MAX]
    times = drive.times[drive.rows[:CLOCK_OFFSET_POSES_MAX]]
    true = np.unwrap(poses[:, 2])
    period = max(float(np.median(np.diff(times))), CLOCK_OFFSET_STEP_S)
    if period > POSE_PERIOD_MAX_S:
        return None
    span = min(2 * int(MOVING_MEAN_PERIOD_S / period / 2) + 1, 2 * (len(times) // 4) + 1)
    return np.array(
        [
            _detrended_sd(np.interp(times - offset, drive.times, headings) - true, span)
            for offset in offsets
        ]
    )


def delay_counts(drive: RecordedDrive, offset: float) -> RecordedDrive:
    """The drive with its counts delayed by `offset` s, without the poses that have no counts."""
    times = drive.times[drive.rows] - offset
    inside = (times >= drive.times[0]) & (times <= drive.times[-1])
    turns = drive.turns_at(drive.times - offset)
    return replace(drive, turns=turns, rows=drive.rows[inside], poses=drive.poses[inside])


def _detrended_sd(mismatch: Floats, span: int) -> float:
    """Standard deviation around the moving mean over `span` poses."""
    padded = np.pad(mismatch, span // 2, mode="edge")
    sums = np.cumsum(np.concatenate(([0.0], padded)))
    return float(np.std(mismatch - (sums[span:] - sums[:-span]) / span))
