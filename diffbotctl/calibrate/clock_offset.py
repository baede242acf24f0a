"""Alignment of two clocks: that of the counts and that of the true poses.

Cameras and wheels are recorded by different computers. While the robot turns at 1 rad/s, a clock
offset of 50 ms looks like an error of 3 degrees, which no geometry explains. So the offset of each
drive is found first, from the change of the heading within seconds, where geometry hardly matters;
from the way of a robot that hardly turns, where it starts, stops and reverses.
"""

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
TURNS_SD_MIN_RAD = 0.05  # of the headings around their moving mean; a straight drive has less
MISMATCH_RATIO_MAX = 0.98  # after over before; above, the robot hardly turned


def clock_offset(drive: RecordedDrive, geometry: Geometry) -> float:
    """The delay (s) of the counts that fits the true headings or ways best; 0 if it cannot be seen.

    CLOCK_OFFSET_MAX_S, of either sign, where it is that or more.
    """
    if len(drive.rows) < CLOCK_OFFSET_POSES_MIN:
        return 0.0
    times = drive.times[drive.rows[:CLOCK_OFFSET_POSES_MAX]]
    period = max(float(np.median(np.diff(times))), CLOCK_OFFSET_STEP_S)
    if period > POSE_PERIOD_MAX_S:
        return 0.0
    rolled = drive.turns * np.pi * (geometry.right, geometry.left)
    span = min(2 * int(MOVING_MEAN_PERIOD_S / period / 2) + 1, 2 * (len(times) // 4) + 1)
    counted = (rolled[:, 0] - rolled[:, 1]) / geometry.track
    true = np.unwrap(drive.poses[: len(times), 2])
    if _detrended_sd(true, span) < TURNS_SD_MIN_RAD:
        counted, true = rolled.mean(axis=1), _way(drive.poses[: len(times)])
    count = round(CLOCK_OFFSET_MAX_S / CLOCK_OFFSET_STEP_S)
    offsets = CLOCK_OFFSET_STEP_S * np.arange(-count, count + 1)
    mismatches = [
        _detrended_sd(np.interp(times - offset, drive.times, counted) - true, span)
        for offset in offsets
    ]
    best = int(np.argmin(mismatches))
    is_seen = mismatches[best] < MISMATCH_RATIO_MAX * mismatches[count]
    return float(offsets[best]) if is_seen else 0.0


def _way(poses: Floats) -> Floats:
    """(poses,): m, ahead."""
    steps, headings = np.diff(poses[:, :2], axis=0), np.unwrap(poses[:, 2])
    middle = (headings[1:] + headings[:-1]) / 2
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    return np.concatenate(([0.0], np.cumsum(ahead)))


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
