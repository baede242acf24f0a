"""Variance of the fourth difference of the edges in five spans, without faults.

It comes from the rounding of counts to whole edges, which depends on their rate, or where edges
have times, from the cut of the slots.
"""

from __future__ import annotations

from itertools import pairwise
from math import exp, sqrt

# Variance of the fourth difference by rounding counts at a constant rate, by the distance of the
# edges in a span from a whole number: means over all phases, exact at these points and linear
# between them.
ROUNDING = (
    (0.0, 0.0),
    (0.2, 7.0 / 18.0),
    (0.25, 0.5),
    (1.0 / 3.0, 0.5),
    (0.4, 1.0),
    (0.5, 16.0 / 9.0),
)
SLOPE_SD = sqrt(2.0)  # standard deviation of five successive numbers
RATE_SD = 0.1  # edges in a span; of the rate that is taken from five counts
# Variance of the difference of edges with times: the slots are cut with a tolerance of 3 % of the
# pitch, and the squared differences of successive weights add up to 7.
SLOT_VARIANCE = 7.0 * 0.03**2


def rounding_variance(rate: float) -> float:
    """Variance of the fourth difference of counts by rounding, at `rate` edges in a span."""
    distance = abs(rate - round(rate))
    for (low, before), (high, after) in pairwise(ROUNDING):
        if distance <= high:
            return before + (after - before) * (distance - low) / (high - low)
    return ROUNDING[-1][1]


def _smoothed(rate: float) -> float:
    """The same where `rate` is known to `RATE_SD`: the mean over a normal distribution."""
    weights = {0.25 * step: exp(-0.5 * (0.25 * step) ** 2) for step in range(-12, 13)}
    total = sum(
        (weight * rounding_variance(rate + sds * RATE_SD) for sds, weight in weights.items()), 0.0
    )
    return total / sum(weights.values(), 0.0)


RATES = 50  # in which a whole edge is divided
ROUNDING_NOISE = tuple(_smoothed(place / RATES) for place in range(RATES))


def count_noise(edges: float, slope: float) -> float:
    """Of five successive counts: `edges` on average, `slope` more in each."""
    low = round(RATES * (edges - SLOPE_SD * slope))
    high = round(RATES * (edges + SLOPE_SD * slope))
    return 0.5 * (ROUNDING_NOISE[low % RATES] + ROUNDING_NOISE[high % RATES])
