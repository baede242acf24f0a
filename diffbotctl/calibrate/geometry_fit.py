"""How far a fitted geometry can be trusted.

Pieces of one drive overlap and share its floor, so they do not count as so many proofs. Drives do:
the variance is taken from how the pulls of whole drives scatter (the cluster-robust "sandwich",
Liang & Zeger, Biometrika 73(1), 1986), and is never let below what the pieces' own errors imply.

Wheel diameters and track from recorded drives: which drives to trust, and how far.

A fit begins with what people get wrong: the columns of the wheels exchanged, or the track stated
from the middle to one wheel. Then the clocks are aligned, drives that do not belong are left out,
and the geometry is adjusted to the rest.

From what a job found to the fields of the robot file that hold it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from math import sqrt
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.clock_offset import clock_offset, delayed
from diffbotctl.calibrate.geometry import Geometry
from diffbotctl.calibrate.least_squares import (
    DIAMETER_PRIOR,
    MEDIANS,
    Adjustment,
    adjust,
    cauchy,
    huber,
    normal_equations,
)
from diffbotctl.calibrate.recorded_drive import Floats, RecordedDrive, Segment, segments
from diffbotctl.calibrate.result import Finding

# Student's t for 95 % both sides, by degrees of freedom; what follows is 2.
STUDENT = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14)
MANY = 2.0
EXACT = 1e-6  # of the floor: drives that scatter less are computed ones
ENDS = 3  # that tell how far they scatter


class Interval(NamedTuple):
    """Relative error of one length, or of the ratio."""

    sd: float
    half: float
    """half the width of the 95 % confidence interval"""


class Confidence(NamedTuple):
    """Of everything that was fitted; each relative to the value itself."""

    right: Interval
    left: Interval
    mean: Interval
    ratio: Interval
    track: Interval


def confidence(result: Adjustment, counts: Sequence[int], diameter_sd: float) -> Confidence:
    """Confidence in `result`, of which each drive brought as many pieces as `counts` says.

    `diameter_sd`: how well (relative) the mean diameter was held to the stated one.
    """
    covariance = _covariance(result, counts, diameter_sd)
    student = STUDENT[len(counts) - 2] if 2 <= len(counts) <= len(STUDENT) + 1 else MANY
    ratio = result.geometry.ratio
    by = {
        "right": np.array([1.0, 1 / (ratio + 1), 0.0]),
        "left": np.array([1.0, -ratio / (ratio + 1), 0.0]),
        "mean": np.array([1.0, 0.0, 0.0]),
        "ratio": np.array([0.0, 1.0, 0.0]),
        "track": np.array([0.0, 0.0, 1.0]),
    }
    found = {name: sqrt(float(row @ covariance @ row)) for name, row in by.items()}
    return Confidence(**{name: Interval(sd, sd * student) for name, sd in found.items()})


def _covariance(result: Adjustment, counts: Sequence[int], diameter_sd: float) -> Floats:
    """(3, 3): of the logarithms of mean, ratio and track."""
    normal, _ = normal_equations(result.misfits, result.weights)
    normal[0, 0] += result.spread / diameter_sd**2
    inverse = np.linalg.pinv(normal)
    # Overlapping pieces say the same several times: as many as lie over one another.
    # An end or two are explained by some geometry however wrong they were measured: how little is
    # missed then proves nothing, so their errors are taken to be what is expected of them.
    spread = result.spread if sum(counts) >= ENDS else max(result.spread, 1.0)
    pieces_own = inverse * spread * _overlap(counts)
    if len(counts) < 2:
        return np.asarray(pieces_own)
    ends = np.cumsum([0, *counts])
    pulls = np.array(
        [
            normal_equations(result.misfits[a:b], result.weights[a:b])[1]
            for a, b in pairwise(ends.tolist())
        ]
    )
    drives = len(counts)
    scatter = inverse @ (pulls.T @ pulls) @ inverse * drives / (drives - 1)
    sd = np.sqrt(np.maximum(np.diag(scatter), 0.0))
    floor = np.sqrt(np.diag(pieces_own))
    if (sd < EXACT * floor).any():
        return np.asarray(pieces_own)
    stretch = np.maximum(1.0, floor / sd)
    return np.asarray(scatter * np.outer(stretch, stretch))


def _overlap(counts: Sequence[int]) -> float:
    from diffbotctl.calibrate.recorded_drive import OVERLAP

    return float(min(OVERLAP, max(counts)))


# In tracks. Shorter pieces are ruled by the noise of the true headings, longer ones no longer tell
# the mean diameter on small squares; chosen by leaving drives out of a real session in turn.
STRETCH = 20.0
TRACKS = (1.0, 2.0, 0.5)  # the true track over the stated one
EVIDENCE = 4.0  # times better must a mistake of the user explain the drives than none
SPARSE = 4  # one piece in so many is enough to recognise a mistake
STRAY = 25.0  # times the usual variance; chance does that to one drive in ten thousand
LEAST_DRIVES = 4  # of which one can be told to be the odd one
DIAMETER_USEFUL = 0.005  # relative sd above which the stated mean diameter is the better one
HELD = 1e-5  # relative sd of a mean diameter that is kept


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
    swapped, times_track, rough = _mistakes(drives, stated)
    righted = [drive.swapped() if swapped else drive for drive in drives]
    offsets = [clock_offset(drive, rough) for drive in righted]
    aligned = [
        delayed(*pair) if pair[1] else pair[0] for pair in zip(righted, offsets, strict=True)
    ]
    kept, strays = _without_strays(aligned, rough, stated)
    pieces = _pieces([aligned[each] for each in kept], rough)
    result, sees_diameter = _final(pieces, rough, stated)
    return GeometryFit(
        stated,
        result.geometry,
        confidence(result, [len(each) for each in pieces], _hold(sees_diameter)),
        [aligned[each] for each in kept],
        [offsets[each] for each in kept],
        strays,
        swapped,
        times_track,
        sees_diameter,
    )


def _mistakes(drives: Sequence[RecordedDrive], stated: Geometry) -> tuple[bool, float, Geometry]:
    """Whether columns are swapped, the true track over the stated, and the rough geometry."""
    found: list[tuple[float, bool, float, Geometry]] = []
    for swapped, times in product((False, True), TRACKS):
        start = stated._replace(track=stated.track * times)
        pieces = _flat(_pieces([drive.swapped() if swapped else drive for drive in drives], start))
        result = adjust(pieces[::SPARSE], start, stated, cauchy)
        score = float(np.median([each.chi for each in result.misfits]))
        drawn_in = abs(np.log(result.geometry.track / start.track)) < np.log(2) / 2
        if drawn_in and abs(np.log(result.geometry.ratio)) < np.log(2) / 2:
            found.append((score, swapped, times, result.geometry))
    if not found:
        raise ValueError("no geometry near the stated one brings these drives to their ends")
    best = min(found, key=lambda each: each[0])
    plain = next((each for each in found if not each[1] and each[2] == 1), None)
    # What the tape cannot tell from chance is no evidence against the person.
    enough = max(EVIDENCE * best[0], MEDIANS[3])
    chosen = plain if plain and plain[0] < enough else best
    return chosen[1:]


def _without_strays(
    drives: Sequence[RecordedDrive], rough: Geometry, stated: Geometry
) -> tuple[list[int], list[Outlier]]:
    """Places of the drives that belong together, and those that do not; at least half stay."""
    pieces = _pieces(drives, rough)
    strays: list[Outlier] = []
    kept = list(range(len(drives)))
    while len(kept) >= LEAST_DRIVES and 2 * (len(kept) - 1) >= len(drives):
        result = adjust(_flat([pieces[each] for each in kept]), rough, stated, cauchy)
        scores = _scores(result, [len(pieces[each]) for each in kept])
        worst = int(np.argmax(scores))
        usual = max(float(np.median(scores)), MEDIANS[3] * result.spread)
        if scores[worst] < STRAY * usual:
            break
        times = float(np.sqrt(scores[worst] / usual))
        strays.append(Outlier(drives[kept.pop(worst)].name, times))
    return kept, strays


def _final(
    pieces: list[list[Segment]], rough: Geometry, stated: Geometry
) -> tuple[Adjustment, bool]:
    """The geometry, and whether the drives tell the mean diameter better than the user does."""
    counts = [len(each) for each in pieces]
    result = adjust(_flat(pieces), rough, stated, huber)
    if confidence(result, counts, DIAMETER_PRIOR).mean.sd < DIAMETER_USEFUL:
        return result, True
    scale = stated.mean / result.geometry.mean
    start = Geometry(*(each * scale for each in result.geometry))
    return adjust(_flat(pieces), start, stated, huber, HELD), False


def _hold(sees_diameter: bool) -> float:
    return DIAMETER_PRIOR if sees_diameter else HELD


def _pieces(drives: Sequence[RecordedDrive], geometry: Geometry) -> list[list[Segment]]:
    return [segments(drive, geometry, STRETCH * geometry.track) for drive in drives]


def _flat(pieces: Sequence[list[Segment]]) -> list[Segment]:
    return [piece for drive in pieces for piece in drive]


def _scores(result: Adjustment, counts: Sequence[int]) -> list[float]:
    """Median misfit of each drive's pieces: one bump does not condemn a long drive."""
    ends = np.cumsum(counts)[:-1]
    chi = np.array([each.chi for each in result.misfits])
    return [float(np.median(each)) for each in np.split(chi, ends)]


RIGHT, LEFT = "drive.right.wheel.diameter", "drive.left.wheel.diameter"
TRACK = "drive.track"


def findings_of_fit(fit: GeometryFit) -> list[Finding]:
    """Both diameters and the track, with what the drives leave open."""
    found, sure = fit.geometry, fit.confidence
    return [
        Finding(RIGHT, found.right, found.right * sure.right.sd),
        Finding(LEFT, found.left, found.left * sure.left.sd),
        Finding(TRACK, found.track, found.track * sure.track.sd),
    ]
