"""Wheel diameters and track from recorded drives.

The fit first looks for common mistakes of the user: swapped columns of the wheels, or a track
stated from the middle to one wheel. Then clocks are aligned, outlying drives are left out, and the
geometry is adjusted to the rest.

Cameras and wheels are recorded by different computers. While the robot turns at 1 rad/s, a clock
offset of 50 ms looks like an error of 3 degrees, which no geometry explains. So the offset of each
drive is found first, from the change of the heading within seconds, where geometry hardly matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.confidence import Confidence, confidence
from diffbotctl.calibrate.dead_reckoning import (
    Floats,
    Geometry,
    RecordedDrive,
    Segment,
    cut_segments,
)
from diffbotctl.calibrate.least_squares import (
    CHI2_MEDIANS,
    DIAMETER_PRIOR_SD,
    Adjustment,
    adjust,
    cauchy_weights,
    huber_weights,
)
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, TRACK, Finding

CLOCK_OFFSET_MAX_S = 0.3  # larger ones are mistakes in the files
CLOCK_OFFSET_STEP_S = 0.005  # at 1 rad/s a third of a degree
CLOCK_OFFSET_POSES_MIN = 40  # in one drive
MOVING_MEAN_PERIOD_S = 2.0  # shorter than most drift, longer than a turn
POSE_PERIOD_MAX_S = 0.2  # at longer periods, chords between poses hide the offset
MISMATCH_RATIO_MAX = 0.98  # after over before; above, the robot hardly turned

# In tracks. Shorter segments are dominated by the noise of the true headings, longer ones do not
# determine the mean diameter on small squares; found by cross-validation on a real session.
SEGMENT_LENGTH_TRACKS = 20.0
TRACK_RATIOS = (1.0, 2.0, 0.5)  # of the true track to the stated one
MISTAKE_SCORE_RATIO_MIN = 4.0  # improvement that proves a mistake of the user
MISTAKE_SUBSAMPLING = 4  # one segment in four is sufficient to detect a mistake
RATIO_LOG_MAX = float(np.log(2)) / 2  # of a plausible wheel ratio, or of the track to its start
OUTLIER_CHI2_RATIO_MIN = 25.0  # one good drive in ten thousand
OUTLIER_DRIVES_MIN = 4
DIAMETER_SD_MAX = 0.005  # relative; above, the stated mean diameter is better than the fitted one
FIXED_DIAMETER_SD = 1e-5  # relative, of a mean diameter that is kept


class Outlier(NamedTuple):
    """A drive that was left out."""

    name: str
    ratio: float
    """of its error to the usual one"""


class GeometryFit(NamedTuple):
    """The result of a fit."""

    stated: Geometry
    geometry: Geometry
    confidence: Confidence
    drives: list[RecordedDrive]
    """the drives used, with columns corrected and clocks aligned"""
    offsets: list[float]
    """s; delay added to the counts of each drive used"""
    outliers: list[Outlier]
    swapped: bool
    """whether the columns of the wheels were swapped"""
    track_ratio: float
    """2: the stated track was half the true one; 0.5: twice; 1: neither"""
    sees_diameter: bool
    """False: the drives do not determine the mean diameter, which was kept as stated"""


def fit_geometry(drives: Sequence[RecordedDrive], stated: Geometry) -> GeometryFit:
    """Fit the geometry to `drives`, starting from the `stated` one.

    Raises ValueError without a drive that has two known poses.
    """
    if not drives:
        raise ValueError("no drives to fit to")
    swapped, track_ratio, rough = _find_mistakes(drives, stated)
    drives = [drive.swapped() if swapped else drive for drive in drives]
    offsets = [clock_offset(drive, rough) for drive in drives]
    drives = [
        delay_counts(drive, offset) if offset else drive
        for drive, offset in zip(drives, offsets, strict=True)
    ]
    kept, outliers = _without_outliers(drives, rough, stated)
    drives, offsets = [drives[number] for number in kept], [offsets[number] for number in kept]
    segments = _segments(drives, rough)
    counts = [len(group) for group in segments]
    flat = _flatten(segments)
    result = adjust(flat, rough, stated, huber_weights)
    result_confidence = confidence(result, counts, DIAMETER_PRIOR_SD)
    sees_diameter = result_confidence.mean.sd < DIAMETER_SD_MAX
    if not sees_diameter:
        scale = stated.mean / result.geometry.mean
        start = Geometry(*(length * scale for length in result.geometry))
        result = adjust(flat, start, stated, huber_weights, FIXED_DIAMETER_SD)
        result_confidence = confidence(result, counts, FIXED_DIAMETER_SD)
    return GeometryFit(
        stated,
        result.geometry,
        result_confidence,
        drives,
        offsets,
        outliers,
        swapped,
        track_ratio,
        sees_diameter,
    )


def geometry_findings(fit: GeometryFit) -> list[Finding]:
    """Both diameters and the track, with their standard deviations."""
    geometry, errors = fit.geometry, fit.confidence
    return [
        Finding(RIGHT_DIAMETER, geometry.right, geometry.right * errors.right.sd),
        Finding(LEFT_DIAMETER, geometry.left, geometry.left * errors.left.sd),
        Finding(TRACK, geometry.track, geometry.track * errors.track.sd),
    ]


class Candidate(NamedTuple):
    """A possible mistake of the user, and the geometry that follows from it."""

    score: float
    swapped: bool
    track_ratio: float
    geometry: Geometry


def _find_mistakes(
    drives: Sequence[RecordedDrive], stated: Geometry
) -> tuple[bool, float, Geometry]:
    """Whether columns are swapped, the ratio of true to stated track, and a rough geometry."""
    candidates: list[Candidate] = []
    for swapped, ratio in product((False, True), TRACK_RATIOS):
        start = stated._replace(track=stated.track * ratio)
        ordered = [drive.swapped() if swapped else drive for drive in drives]
        segments = _flatten(_segments(ordered, start))[::MISTAKE_SUBSAMPLING]
        result = adjust(segments, start, stated, cauchy_weights)
        geometry = result.geometry
        score = float(np.median([residual.chi2 for residual in result.residuals]))
        log_ratios = np.abs(np.log([geometry.track / start.track, geometry.ratio]))
        if (log_ratios < RATIO_LOG_MAX).all():
            candidates.append(Candidate(score, swapped, ratio, geometry))
    if not candidates:
        raise ValueError("no geometry near the stated one explains the ends of these drives")
    chosen = min(candidates, key=lambda candidate: candidate.score)
    # An improvement within the accuracy of the measured ends does not prove a mistake.
    limit = max(MISTAKE_SCORE_RATIO_MIN * chosen.score, CHI2_MEDIANS[3])
    for candidate in candidates:
        if not candidate.swapped and candidate.track_ratio == 1 and candidate.score < limit:
            chosen = candidate
    return chosen.swapped, chosen.track_ratio, chosen.geometry


def _without_outliers(
    drives: Sequence[RecordedDrive], rough: Geometry, stated: Geometry
) -> tuple[list[int], list[Outlier]]:
    """Indices of the drives that agree, and those that do not; at least half are kept."""
    segments = _segments(drives, rough)
    outliers: list[Outlier] = []
    kept = list(range(len(drives)))
    while len(kept) >= OUTLIER_DRIVES_MIN and 2 * (len(kept) - 1) >= len(drives):
        groups = [segments[number] for number in kept]
        result = adjust(_flatten(groups), rough, stated, cauchy_weights)
        scores = _median_chi2(result, [len(group) for group in groups])
        worst = int(np.argmax(scores))
        usual = max(float(np.median(scores)), CHI2_MEDIANS[3] * result.variance_ratio)
        if scores[worst] < OUTLIER_CHI2_RATIO_MIN * usual:
            break
        ratio = float(np.sqrt(scores[worst] / usual))
        outliers.append(Outlier(drives[kept.pop(worst)].name, ratio))
    return kept, outliers


def _segments(drives: Sequence[RecordedDrive], geometry: Geometry) -> list[list[Segment]]:
    length = SEGMENT_LENGTH_TRACKS * geometry.track
    return [cut_segments(drive, geometry.mean, length) for drive in drives]


def _flatten(groups: Sequence[list[Segment]]) -> list[Segment]:
    return [segment for group in groups for segment in group]


def _median_chi2(result: Adjustment, counts: Sequence[int]) -> list[float]:
    """Of the segments of each drive: one bump does not make a long drive an outlier."""
    chi2 = np.array([residual.chi2 for residual in result.residuals])
    return [float(np.median(group)) for group in np.split(chi2, np.cumsum(counts)[:-1])]


def clock_offset(drive: RecordedDrive, geometry: Geometry) -> float:
    """The delay (s) of the counts that fits the true headings best; 0 if it cannot be seen."""
    if len(drive.rows) < CLOCK_OFFSET_POSES_MIN:
        return 0.0
    rolled = drive.turns * np.pi * (geometry.right, geometry.left)
    headings = (rolled[:, 0] - rolled[:, 1]) / geometry.track
    times = drive.times[drive.rows]
    period = max(float(np.median(np.diff(times))), CLOCK_OFFSET_STEP_S)
    if period > POSE_PERIOD_MAX_S:
        return 0.0
    span = min(2 * int(MOVING_MEAN_PERIOD_S / period / 2) + 1, 2 * (len(times) // 4) + 1)
    step = CLOCK_OFFSET_STEP_S
    offsets = np.arange(-CLOCK_OFFSET_MAX_S, CLOCK_OFFSET_MAX_S + step / 2, step)
    mismatches = [
        _detrended_sd(np.interp(times - offset, drive.times, headings) - drive.poses[:, 2], span)
        for offset in offsets
    ]
    best = int(np.argmin(mismatches))
    limit = MISMATCH_RATIO_MAX * mismatches[len(offsets) // 2]
    return float(offsets[best]) if mismatches[best] < limit else 0.0


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
