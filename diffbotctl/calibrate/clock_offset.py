"""Alignment of two clocks: that of the counts and that of the true poses.

The headings show it where the robot turns. A robot that drives ahead only shows it by its way,
where it starts, stops and reverses.
"""

from __future__ import annotations

from collections.abc import Callable
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
OTHER_CLOCK_MOTION_RATIO_MAX = 0.3  # of the mismatch to the turns, or the way, of the robot
TURNS_SD_MIN_RAD = 0.05  # of the headings around their moving mean; a straight drive has less
WAYS_SD_MIN_M = 0.01  # of the ways, the same


def clock_offset(drive: RecordedDrive, geometry: Geometry) -> float:
    """The delay (s) of the counts that fits the true headings, or ways, best; 0 if it cannot be
    seen."""
    step = CLOCK_OFFSET_STEP_S
    offsets = np.arange(-CLOCK_OFFSET_MAX_S, CLOCK_OFFSET_MAX_S + step / 2, step)
    found = _clearest_signal(drive)
    mismatches = None if found is None else _mismatches(drive, geometry, found[0], offsets)
    if mismatches is None:
        return 0.0
    best = int(np.argmin(mismatches))
    is_seen = mismatches[best] < MISMATCH_RATIO_MAX * mismatches[len(offsets) // 2]
    return float(offsets[best]) if is_seen else 0.0


def other_clock(drive: RecordedDrive, geometry: Geometry) -> float | None:
    """The delay (s) of the counts if it is larger than two clocks of one recording differ; None if
    it is not, or cannot be seen."""
    step = OTHER_CLOCK_STEP_S
    offsets = np.arange(-OTHER_CLOCK_MAX_S, OTHER_CLOCK_MAX_S + step / 2, step)
    found = _clearest_signal(drive)
    if found is None:
        return None
    signal, motion = found
    mismatches = _mismatches(drive, geometry, signal, offsets)
    if mismatches is None:
        return None
    best = int(np.argmin(mismatches))
    usual = mismatches[np.abs(offsets) <= CLOCK_OFFSET_MAX_S].min()
    limit = min(OTHER_CLOCK_RATIO_MAX * usual, OTHER_CLOCK_MOTION_RATIO_MAX * motion)
    return float(offsets[best]) if mismatches[best] < limit else None


Signal = Callable[[RecordedDrive, Geometry], tuple[Floats, Floats]]
"""By the counts, (rows,), and by the true poses, (poses,)"""


def _headings(drive: RecordedDrive, geometry: Geometry) -> tuple[Floats, Floats]:
    """In rad."""
    rolled = drive.turns * np.pi * (geometry.right, geometry.left)
    headings = (rolled[:, 0] - rolled[:, 1]) / geometry.track
    return headings, np.unwrap(drive.poses[:, 2])


def _ways(drive: RecordedDrive, geometry: Geometry) -> tuple[Floats, Floats]:
    """In m, ahead."""
    rolled = drive.turns * np.pi * (geometry.right, geometry.left)
    steps, headings = np.diff(drive.poses[:, :2], axis=0), np.unwrap(drive.poses[:, 2])
    middle = (headings[1:] + headings[:-1]) / 2
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    return rolled.mean(axis=1), np.concatenate(([0.0], np.cumsum(ahead)))


def _clearest_signal(drive: RecordedDrive) -> tuple[Signal, float] | None:
    """The headings where the robot turns, or else its ways, with their standard deviation around
    their moving mean; None where it hardly moves, and for too few poses.

    Half a count by which the counts are late on average delays the ways more than the headings.
    """
    standing = replace(drive, turns=np.zeros_like(drive.turns))
    any_geometry = Geometry(1.0, 1.0, 1.0)  # the wheels of that drive stand
    for signal, motion_min in ((_headings, TURNS_SD_MIN_RAD), (_ways, WAYS_SD_MIN_M)):
        motion = _mismatches(standing, any_geometry, signal, np.zeros(1))
        if motion is not None and motion[0] >= motion_min:
            return signal, float(motion[0])
    return None


def _mismatches(
    drive: RecordedDrive, geometry: Geometry, signal: Signal, offsets: Floats
) -> Floats | None:
    """(offsets,): of the signal if the counts are delayed by each of the offsets (s); None for too
    few poses."""
    if len(drive.rows) < CLOCK_OFFSET_POSES_MIN:
        return None
    counted, true = signal(drive, geometry)
    times, true = drive.times[drive.rows[:CLOCK_OFFSET_POSES_MAX]], true[:CLOCK_OFFSET_POSES_MAX]
    period = max(float(np.median(np.diff(times))), CLOCK_OFFSET_STEP_S)
    if period > POSE_PERIOD_MAX_S:
        return None
    span = min(2 * int(MOVING_MEAN_PERIOD_S / period / 2) + 1, 2 * (len(times) // 4) + 1)
    return np.array(
        [
            _detrended_sd(np.interp(times - offset, drive.times, counted) - true, span)
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
