"""The clock of the true poses against the clock of the counts.

Cameras and wheels are recorded by different machines. While the robot turns at 1 rad/s, 50 ms
between their clocks look like 3 degrees of heading, which no geometry explains; so each drive's
offset is found first, from how its heading moves within seconds, where geometry hardly matters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diffbotctl.calibrate.geometry import Geometry
from diffbotctl.calibrate.recorded_drive import Floats, RecordedDrive

FURTHEST = 0.3  # s; clocks further apart are a mistake in the files, not a delay
STEP = 0.005  # s; at 1 rad/s a third of a degree
SWEPT = 2.0  # s over which the mismatch is levelled: shorter than most drift, longer than a turn
LEAST_POSES = 40  # known within a drive: fewer do not show how it moved
SLOWEST = 0.2  # s between poses; where they are sparser, chords between them hide the offset
LEAST_GAIN = 0.98  # of the mismatch left; else the robot hardly turned, and chance decides


def clock_offset(drive: RecordedDrive, geometry: Geometry) -> float:
    """Seconds by which the counts are to be delayed to fit the true headings; 0 when unseen."""
    if len(drive.rows) < LEAST_POSES:
        return 0.0
    rolled = drive.turns * np.pi * (geometry.right, geometry.left)
    headings = (rolled[:, 0] - rolled[:, 1]) / geometry.track
    known = drive.times[drive.rows]
    period = max(float(np.median(np.diff(known))), STEP)
    if period > SLOWEST:
        return 0.0
    span = min(2 * int(SWEPT / period / 2) + 1, 2 * (len(known) // 4) + 1)
    offsets = np.arange(-FURTHEST, FURTHEST + STEP / 2, STEP)
    left = [
        _unevenness(np.interp(known - each, drive.times, headings) - drive.poses[:, 2], span)
        for each in offsets
    ]
    best = int(np.argmin(left))
    now = left[len(offsets) // 2]
    return float(offsets[best]) if left[best] < LEAST_GAIN * now else 0.0


def delayed(drive: RecordedDrive, offset: float) -> RecordedDrive:
    """The drive with its counts later by `offset` s, less the poses without counts."""
    known = drive.times[drive.rows] - offset
    inside = (known >= drive.times[0]) & (known <= drive.times[-1])
    at = drive.times - offset
    turns = np.stack([np.interp(at, drive.times, wheel) for wheel in drive.turns.T], axis=1)
    return replace(drive, turns=turns, rows=drive.rows[inside], poses=drive.poses[inside])


def _unevenness(mismatch: Floats, span: int) -> float:
    """Standard deviation of what is left when a moving mean over `span` poses is taken off."""
    padded = np.pad(mismatch, span // 2, mode="edge")
    sums = np.cumsum(np.concatenate(([0.0], padded)))
    return float(np.std(mismatch - (sums[span:] - sums[:-span]) / span))
