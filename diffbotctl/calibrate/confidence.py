"""How far a fitted geometry can be trusted.

Pieces of one drive overlap and share its floor, so they do not count as so many proofs. Drives do:
the variance is taken from how the pulls of whole drives scatter (the cluster-robust "sandwich",
Liang & Zeger, Biometrika 73(1), 1986), and is never let below what the pieces' own errors imply.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import sqrt
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.adjustment import Adjusted, normal_equations
from diffbotctl.calibrate.drive import Floats

# Student's t for 95 % both sides, by degrees of freedom; what follows is 2.
STUDENT = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14)
MANY = 2.0
EXACT = 1e-6  # of the floor: drives that scatter less are computed ones
ENDS = 3  # that tell how far they scatter


class Bound(NamedTuple):
    """Relative error of one length, or of the ratio."""

    sd: float
    half: float
    """half the width of the 95 % confidence interval"""


class Confidence(NamedTuple):
    """Of everything that was fitted; each relative to the value itself."""

    right: Bound
    left: Bound
    mean: Bound
    ratio: Bound
    track: Bound


def confidence(result: Adjusted, counts: Sequence[int], diameter_sd: float) -> Confidence:
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
    return Confidence(**{name: Bound(sd, sd * student) for name, sd in found.items()})


def _covariance(result: Adjusted, counts: Sequence[int], diameter_sd: float) -> Floats:
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
    from diffbotctl.calibrate.drive import OVERLAP

    return float(min(OVERLAP, max(counts)))
