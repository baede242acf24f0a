"""What may be wrong with recorded drives that no geometry explains.

None of this is wrong by itself: a robot may turn around a wheel that stands, and on the spot in
few rows. So it is reported only of drives that do not agree with the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry, RecordedDrive
from diffbotctl.calibrate.log_checks import DEAD_COUNTS_MIN, DEAD_RATIO_MAX, WHEELS

SILENT_RATIO_MIN = 0.15  # of the counts of the other wheel, while one does not count
TURN_MAX_RAD = 0.8  # between two rows; a chord no longer shows where the arc ends
TURN_ROWS_MIN = 3
DOUBTS_SHOWN_MAX = 2
# Of the track. A robot that turns around a wheel moves its middle by at most one track.
REACH_TRACKS_MAX = 1.2


def doubts_text(drives: Sequence[RecordedDrive], geometry: Geometry) -> str | None:
    """A text about the first of the drives with a doubt, and how many others have one; None if
    there is none."""
    found = [(drive.name, doubt) for drive in drives if (doubt := drive_doubt(drive, geometry))]
    if not found:
        return None
    texts = [f"in {name} {doubt}" for name, doubt in found[:DOUBTS_SHOWN_MAX]]
    more = len(found) - len(texts)
    return "; ".join(texts) + (f"; and alike in {more} more" if more else "")


def drive_doubt(drive: RecordedDrive, geometry: Geometry) -> str | None:
    """What looks wrong in the counts of `drive`; None if nothing does. `geometry`: about right."""
    counts = drive.turns / drive.tick
    return silent_encoder(drive.times, counts) or _coarse_rows(drive, geometry)


def silent_encoder(times: Floats, counts: Floats) -> str | None:
    """Which encoder counts nothing for a part of the drive in which the other one does.

    `times` (rows,) in s, `counts` (rows, 2).
    """
    for wheel, other, own, others in zip(
        WHEELS, WHEELS[::-1], counts.T, counts.T[::-1], strict=True
    ):
        total, before, after = _silence(own, others)
        if max(before, after) < max(SILENT_RATIO_MIN * total, DEAD_COUNTS_MIN):
            continue
        moving = np.flatnonzero(np.diff(own))
        size = float(np.abs(np.diff(own)).sum())
        if size <= DEAD_RATIO_MAX * total:
            return f"the {wheel} encoder counted {size:.0f}, the {other} one {total:.0f}"
        if after >= before:
            when = f"after {times[moving[-1] + 1] - times[0]:.1f} s"
            return f"the {wheel} encoder counted nothing {when}, but the {other} one {after:.0f}"
        when = f"before {times[moving[0]] - times[0]:.1f} s"
        return f"the {wheel} encoder counted nothing {when}, but the {other} one {before:.0f}"
    return None


def is_dead(drive: RecordedDrive, geometry: Geometry) -> bool:
    """Whether an encoder counted nothing while the robot moved further than around that wheel."""
    counts = drive.turns / drive.tick
    for own, others in zip(counts.T, counts.T[::-1], strict=True):
        moving = np.flatnonzero(np.diff(own))
        sizes = np.abs(np.diff(own)).sum(), np.abs(np.diff(others)).sum()
        last = len(own) - 1
        parts = [(0, last)]
        if sizes[0] > DEAD_RATIO_MAX * sizes[1]:
            parts = [(0, int(moving[0])), (int(moving[-1]) + 1, last)]
        if any(_is_beyond_reach(drive, others, part, geometry) for part in parts):
            return True
    return False


def _is_beyond_reach(
    drive: RecordedDrive, others: Floats, part: tuple[int, int], geometry: Geometry
) -> bool:
    first, last = part
    if np.abs(np.diff(others[first : last + 1])).sum() < DEAD_COUNTS_MIN:
        return False
    poses = drive.poses[(drive.rows >= first) & (drive.rows <= last), :2]
    if not len(poses):
        return False
    reach = float(np.hypot(*(poses - poses[0]).T).max())
    return reach > REACH_TRACKS_MAX * geometry.track


def _silence(own: Floats, others: Floats) -> tuple[float, float, float]:
    """Counts of the other wheel in all, before the first count of this one, and after its last."""
    steps = np.abs(np.diff(others))
    moving = np.flatnonzero(np.diff(own))
    total = float(steps.sum())
    if not len(moving):
        return total, total, total
    return total, float(steps[: moving[0]].sum()), float(steps[moving[-1] + 1 :].sum())


def _coarse_rows(drive: RecordedDrive, geometry: Geometry) -> str | None:
    rolled = np.diff(drive.turns, axis=0) * np.pi * (geometry.right, geometry.left)
    turned = np.abs(rolled[:, 0] - rolled[:, 1]) / geometry.track
    if np.count_nonzero(turned > TURN_MAX_RAD) < TURN_ROWS_MIN:
        return None
    angle = degrees(float(turned.max()))
    return (
        f"the robot turned by up to {angle:.0f} degrees from one row to the next: write more rows"
    )
