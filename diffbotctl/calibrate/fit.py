"""Wheel diameters and track from recorded drives: which drives to trust, and how far.

A fit begins with what people get wrong: the columns of the wheels exchanged, or the track stated
from the middle to one wheel. Then the clocks are aligned, drives that do not belong are left out,
and the geometry is adjusted to the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.adjustment import (
    DIAMETER_PRIOR,
    MEDIANS,
    Adjusted,
    adjust,
    cauchy,
    huber,
)
from diffbotctl.calibrate.alignment import clock_offset, delayed
from diffbotctl.calibrate.confidence import Confidence, confidence
from diffbotctl.calibrate.drive import Drive, Stretch, stretches
from diffbotctl.calibrate.geometry import Geometry

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


class Stray(NamedTuple):
    """A drive that was left out."""

    name: str
    times: float
    """how many times the usual error it was off"""


class Fit(NamedTuple):
    """What the drives came to."""

    stated: Geometry
    geometry: Geometry
    confidence: Confidence
    drives: list[Drive]
    """those used, columns put right and clocks aligned"""
    offsets: list[float]
    """s; what the counts of each drive used were delayed by"""
    strays: list[Stray]
    swapped: bool
    """the columns of the wheels were exchanged"""
    times_track: float
    """2: the stated track was the half; 0.5: it was the double; 1: neither"""
    sees_diameter: bool
    """False: the drives do not tell the mean diameter, which was kept as stated"""


def fit(drives: Sequence[Drive], stated: Geometry) -> Fit:
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
    return Fit(
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


def _mistakes(drives: Sequence[Drive], stated: Geometry) -> tuple[bool, float, Geometry]:
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
    drives: Sequence[Drive], rough: Geometry, stated: Geometry
) -> tuple[list[int], list[Stray]]:
    """Places of the drives that belong together, and those that do not; at least half stay."""
    pieces = _pieces(drives, rough)
    strays: list[Stray] = []
    kept = list(range(len(drives)))
    while len(kept) >= LEAST_DRIVES and 2 * (len(kept) - 1) >= len(drives):
        result = adjust(_flat([pieces[each] for each in kept]), rough, stated, cauchy)
        scores = _scores(result, [len(pieces[each]) for each in kept])
        worst = int(np.argmax(scores))
        usual = max(float(np.median(scores)), MEDIANS[3] * result.spread)
        if scores[worst] < STRAY * usual:
            break
        times = float(np.sqrt(scores[worst] / usual))
        strays.append(Stray(drives[kept.pop(worst)].name, times))
    return kept, strays


def _final(pieces: list[list[Stretch]], rough: Geometry, stated: Geometry) -> tuple[Adjusted, bool]:
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


def _pieces(drives: Sequence[Drive], geometry: Geometry) -> list[list[Stretch]]:
    return [stretches(drive, geometry, STRETCH * geometry.track) for drive in drives]


def _flat(pieces: Sequence[list[Stretch]]) -> list[Stretch]:
    return [piece for drive in pieces for piece in drive]


def _scores(result: Adjusted, counts: Sequence[int]) -> list[float]:
    """Median misfit of each drive's pieces: one bump does not condemn a long drive."""
    ends = np.cumsum(counts)[:-1]
    chi = np.array([each.chi for each in result.misfits])
    return [float(np.median(each)) for each in np.split(chi, ends)]
