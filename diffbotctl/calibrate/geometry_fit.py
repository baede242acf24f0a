"""Wheel diameters and track from recorded drives: which drives to trust, and how far.

A fit begins with what people get wrong: the columns of the wheels exchanged, or the track stated
from the middle to one wheel. Then the clocks are aligned, drives that do not belong are left out,
and the geometry is adjusted to the rest.

Clocks: cameras and wheels are recorded by different machines. While the robot turns at 1 rad/s,
50 ms between their clocks look like 3 degrees of heading, which no geometry explains; so each
drive's offset is found first, from how its heading moves within seconds, where geometry hardly
matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.confidence import Confidence, confidence
from diffbotctl.calibrate.dead_reckoning import Floats, Geometry, RecordedDrive, Segment, segments
from diffbotctl.calibrate.least_squares import (
    CHI2_MEDIANS,
    DIAMETER_PRIOR_SD,
    Adjustment,
    adjust,
    cauchy_weights,
    huber_weights,
)
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, TRACK, Finding

CLOCK_OFFSET_MAX_S = 0.3  # s; clocks further apart are a mistake in the files, not a delay
CLOCK_OFFSET_STEP_S = 0.005  # s; at 1 rad/s a third of a degree
MOVING_MEAN_PERIOD_S = (
    2.0  # s over which the mismatch is levelled: shorter than most drift, longer than a turn
)
CLOCK_OFFSET_POSES_MIN = 40  # known within a drive: fewer do not show how it moved
POSE_PERIOD_MAX_S = (
    0.2  # s between poses; where they are sparser, chords between them hide the offset
)
MISMATCH_RATIO_MAX = 0.98  # of the mismatch left; else the robot hardly turned, and chance decides


def clock_offset(drive: RecordedDrive, geometry: Geometry) -> float:
    """Seconds by which the counts are to be delayed to fit the true headings; 0 when unseen."""
    if len(drive.rows) < CLOCK_OFFSET_POSES_MIN:
        return 0.0
    rolled = drive.turns * np.pi * (geometry.right, geometry.left)
    headings = (rolled[:, 0] - rolled[:, 1]) / geometry.track
    known = drive.times[drive.rows]
    period = max(float(np.median(np.diff(known))), CLOCK_OFFSET_STEP_S)
    if period > POSE_PERIOD_MAX_S:
        return 0.0
    span = min(2 * int(MOVING_MEAN_PERIOD_S / period / 2) + 1, 2 * (len(known) // 4) + 1)
    offsets = np.arange(
        -CLOCK_OFFSET_MAX_S, CLOCK_OFFSET_MAX_S + CLOCK_OFFSET_STEP_S / 2, CLOCK_OFFSET_STEP_S
    )
    left = [
        _detrended_sd(np.interp(known - each, drive.times, headings) - drive.poses[:, 2], span)
        for each in offsets
    ]
    best = int(np.argmin(left))
    now = left[len(offsets) // 2]
    return float(offsets[best]) if left[best] < MISMATCH_RATIO_MAX * now else 0.0


def delay_counts(drive: RecordedDrive, offset: float) -> RecordedDrive:
    """The drive with its counts later by `offset` s, less the poses without counts."""
    known = drive.times[drive.rows] - offset
    inside = (known >= drive.times[0]) & (known <= drive.times[-1])
    at = drive.times - offset
    turns = np.stack([np.interp(at, drive.times, wheel) for wheel in drive.turns.T], axis=1)
    return replace(drive, turns=turns, rows=drive.rows[inside], poses=drive.poses[inside])


def _detrended_sd(mismatch: Floats, span: int) -> float:
    """Standard deviation of what is left when a moving mean over `span` poses is taken off."""
    padded = np.pad(mismatch, span // 2, mode="edge")
    sums = np.cumsum(np.concatenate(([0.0], padded)))
    return float(np.std(mismatch - (sums[span:] - sums[:-span]) / span))


# In tracks. Shorter pieces are ruled by the noise of the true headings, longer ones no longer tell
# the mean diameter on small squares; chosen by leaving drives out of a real session in turn.
SEGMENT_LENGTH_TRACKS = 20.0
TRACK_RATIOS = (1.0, 2.0, 0.5)  # the true track over the stated one
MISTAKE_SCORE_RATIO = 4.0  # times better must a mistake of the user explain the drives than none
MISTAKE_SUBSAMPLING = 4  # one piece in so many is enough to recognise a mistake
OUTLIER_CHI2_RATIO = 25.0  # times the usual variance; chance does that to one drive in ten thousand
OUTLIER_DRIVES_MIN = 4  # of which one can be told to be the odd one
DIAMETER_SD_MAX = 0.005  # relative sd above which the stated mean diameter is the better one
FIXED_DIAMETER_SD = 1e-5  # relative sd of a mean diameter that is kept


class Outlier(NamedTuple):
    """A drive that was left out."""

    name: str
    times: float
    """how many times the usual error it was off"""


class GeometryFit(NamedTuple):
    """What the drives came to."""

    stated: Geometry
    geometry: Geometry
    confidence: Confidence
    drives: list[RecordedDrive]
    """those used, columns put right and clocks aligned"""
    offsets: list[float]
    """s; what the counts of each drive used were delayed by"""
    strays: list[Outlier]
    swapped: bool
    """the columns of the wheels were exchanged"""
    times_track: float
    """2: the stated track was the half; 0.5: it was the double; 1: neither"""
    sees_diameter: bool
    """False: the drives do not tell the mean diameter, which was kept as stated"""


def fit_geometry(drives: Sequence[RecordedDrive], stated: Geometry) -> GeometryFit:
    """Fit the geometry to `drives`, beginning from the one `stated`.

    Raises ValueError without a drive that has two known poses.
    """
    if not drives:
        raise ValueError("no drives to fit to")
    swapped, times_track, rough = _find_mistakes(drives, stated)
    righted = [drive.swapped() if swapped else drive for drive in drives]
    offsets = [clock_offset(drive, rough) for drive in righted]
    aligned = [
        delay_counts(*pair) if pair[1] else pair[0] for pair in zip(righted, offsets, strict=True)
    ]
    kept, strays = _without_outliers(aligned, rough, stated)
    pieces = _segments([aligned[each] for each in kept], rough)
    result, sees_diameter = _final_fit(pieces, rough, stated)
    return GeometryFit(
        stated,
        result.geometry,
        confidence(
            result,
            [len(each) for each in pieces],
            DIAMETER_PRIOR_SD if sees_diameter else FIXED_DIAMETER_SD,
        ),
        [aligned[each] for each in kept],
        [offsets[each] for each in kept],
        strays,
        swapped,
        times_track,
        sees_diameter,
    )


def _find_mistakes(
    drives: Sequence[RecordedDrive], stated: Geometry
) -> tuple[bool, float, Geometry]:
    """Whether columns are swapped, the true track over the stated, and the rough geometry."""
    found: list[tuple[float, bool, float, Geometry]] = []
    for swapped, times in product((False, True), TRACK_RATIOS):
        start = stated._replace(track=stated.track * times)
        pieces = _flatten(
            _segments([drive.swapped() if swapped else drive for drive in drives], start)
        )
        result = adjust(pieces[::MISTAKE_SUBSAMPLING], start, stated, cauchy_weights)
        score = float(np.median([each.chi for each in result.misfits]))
        drawn_in = abs(np.log(result.geometry.track / start.track)) < np.log(2) / 2
        if drawn_in and abs(np.log(result.geometry.ratio)) < np.log(2) / 2:
            found.append((score, swapped, times, result.geometry))
    if not found:
        raise ValueError("no geometry near the stated one brings these drives to their ends")
    best = min(found, key=lambda each: each[0])
    plain = next((each for each in found if not each[1] and each[2] == 1), None)
    # What the tape cannot tell from chance is no evidence against the person.
    enough = max(MISTAKE_SCORE_RATIO * best[0], CHI2_MEDIANS[3])
    chosen = plain if plain and plain[0] < enough else best
    return chosen[1:]


def _without_outliers(
    drives: Sequence[RecordedDrive], rough: Geometry, stated: Geometry
) -> tuple[list[int], list[Outlier]]:
    """Places of the drives that belong together, and those that do not; at least half stay."""
    pieces = _segments(drives, rough)
    strays: list[Outlier] = []
    kept = list(range(len(drives)))
    while len(kept) >= OUTLIER_DRIVES_MIN and 2 * (len(kept) - 1) >= len(drives):
        result = adjust(_flatten([pieces[each] for each in kept]), rough, stated, cauchy_weights)
        scores = _median_chi2(result, [len(pieces[each]) for each in kept])
        worst = int(np.argmax(scores))
        usual = max(float(np.median(scores)), CHI2_MEDIANS[3] * result.spread)
        if scores[worst] < OUTLIER_CHI2_RATIO * usual:
            break
        times = float(np.sqrt(scores[worst] / usual))
        strays.append(Outlier(drives[kept.pop(worst)].name, times))
    return kept, strays


def _final_fit(
    pieces: list[list[Segment]], rough: Geometry, stated: Geometry
) -> tuple[Adjustment, bool]:
    """The geometry, and whether the drives tell the mean diameter better than the user does."""
    counts = [len(each) for each in pieces]
    result = adjust(_flatten(pieces), rough, stated, huber_weights)
    if confidence(result, counts, DIAMETER_PRIOR_SD).mean.sd < DIAMETER_SD_MAX:
        return result, True
    scale = stated.mean / result.geometry.mean
    start = Geometry(*(each * scale for each in result.geometry))
    return adjust(_flatten(pieces), start, stated, huber_weights, FIXED_DIAMETER_SD), False


def _segments(drives: Sequence[RecordedDrive], geometry: Geometry) -> list[list[Segment]]:
    return [segments(drive, geometry, SEGMENT_LENGTH_TRACKS * geometry.track) for drive in drives]


def _flatten(pieces: Sequence[list[Segment]]) -> list[Segment]:
    return [piece for drive in pieces for piece in drive]


def _median_chi2(result: Adjustment, counts: Sequence[int]) -> list[float]:
    """Median misfit of each drive's pieces: one bump does not condemn a long drive."""
    ends = np.cumsum(counts)[:-1]
    chi = np.array([each.chi for each in result.misfits])
    return [float(np.median(each)) for each in np.split(chi, ends)]


def geometry_findings(fit: GeometryFit) -> list[Finding]:
    """Both diameters and the track, with what the drives leave open."""
    found, sure = fit.geometry, fit.confidence
    return [
        Finding(RIGHT_DIAMETER, found.right, found.right * sure.right.sd),
        Finding(LEFT_DIAMETER, found.left, found.left * sure.left.sd),
        Finding(TRACK, found.track, found.track * sure.track.sd),
    ]
