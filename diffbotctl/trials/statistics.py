"""What a number of runs proves: shares with their bounds, and differences of pairs."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, lgamma, log, log1p, sqrt
from statistics import NormalDist, fmean, stdev
from typing import NamedTuple

CONFIDENCE = 0.95
BISECTIONS = 50


class ConfidenceInterval(NamedTuple):
    """A value and the ends of its interval of 95 % confidence."""

    value: float
    low: float
    high: float

    @property
    def is_proven(self) -> bool:
        """Whether it excludes 0."""
        return self.low > 0.0 or self.high < 0.0


def proven_share(passed: int, runs: int) -> float:
    """The share of all such runs that at least passes, with 95 % confidence.

    The one-sided bound of Clopper and Pearson (Biometrika 26, 1934). When all of n pass it is
    0.05 ** (1 / n), about 1 - 3 / n: the rule of three.
    """
    if not passed:
        return 0.0
    low, high = 0.0, passed / runs  # there the terms of the tail fall from the first one on
    ways = lgamma(runs + 1) - lgamma(passed + 1) - lgamma(runs - passed + 1)
    for _ in range(BISECTIONS):
        share = 0.5 * (low + high)
        term = tail = exp(ways + passed * log(share) + (runs - passed) * log1p(-share))
        for k in range(passed, runs):
            term *= (runs - k) / (k + 1) * share / (1.0 - share)
            if tail + term == tail:
                break
            tail += term
        if tail < 1.0 - CONFIDENCE:
            low = share
        else:
            high = share
    return low


def paired_shares(pairs: Sequence[tuple[bool, bool]]) -> ConfidenceInterval:
    """Difference of the shares that pass, the second of each pair less the first.

    The interval of Agresti and Min (Biostatistics 6, 2005): half a pair is added to each kind.
    """
    gained = sum(after and not before for before, after in pairs) + 0.5
    lost = sum(before and not after for before, after in pairs) + 0.5
    count = len(pairs) + 2.0
    difference = (gained - lost) / count
    variance = (gained + lost - (gained - lost) ** 2 / count) / count**2
    half = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2) * sqrt(variance)
    exact = (gained - lost) / max(len(pairs), 1)
    return ConfidenceInterval(exact, difference - half, difference + half)


def mean_difference(differences: Sequence[float]) -> ConfidenceInterval | None:
    """Mean of the differences of pairs, by Student's t; None of fewer than three."""
    if len(differences) < 3:
        return None
    mean = fmean(differences)
    half = _t_quantile(len(differences) - 1) * stdev(differences) / sqrt(len(differences))
    return ConfidenceInterval(mean, mean - half, mean + half)


def _t_quantile(freedom: int) -> float:
    """The quantile of Student's t for a two-sided 95 %, by Hill's expansion (CACM 396, 1970)."""
    z = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2)
    first = (z**3 + z) / 4
    second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return z + first / freedom + second / freedom**2 + third / freedom**3
