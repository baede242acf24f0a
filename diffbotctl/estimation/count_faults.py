"""Faults of a fine encoder, from the regularity of its counts.

The speed of a wheel changes smoothly; a missed or an additional edge changes a count at once. The
fourth difference of the counts in successive spans of time removes the smooth part: a wheel turns
too steadily for anything else to remain than the faults and the rounding to whole edges. The
variance that remains for each edge is the share of faults (variance of a Poisson process).

Whether edges were missing or counted twice would follow from the third moment, but on the few
hundred spans of a drive its sign is too uncertain: a wrong correction of one wheel turned simulated
robots by 30 degrees. So the share is taken as a standard deviation of the travel: the root of its
mean square over what the share may be, since on a short drive no counts rule a few faults out.
"""

from __future__ import annotations

from math import exp, log, sqrt
from operator import mul

# The first span has so many edges; the next ones have as many frames, so that rounding is not
# favoured in one direction, until their edges leave the limits.
FIRST_EDGES_MIN = 8
SPAN_EDGES_MIN, SPAN_EDGES_RATIO_MAX = 5, 2.5
SPAN_SECONDS_MAX = 0.2
WEIGHTS = (1.0 / 6.0, -4.0 / 6.0, 1.0, -4.0 / 6.0, 1.0 / 6.0)
SQUARES = sum(weight**2 for weight in WEIGHTS)
# Variance of the fourth difference by rounding the counts: the sum of the squared differences of
# successive weights, times that of a uniform distribution over one edge.
ROUNDING_VARIANCE = (
    sum(
        (after - before) ** 2
        for before, after in zip((0.0, *WEIGHTS), (*WEIGHTS, 0.0), strict=True)
    )
    / 12.0
)
# At a rate of a whole number and a half, every second count is rounded up: the alternating weights
# add up to 32 / 6, times a quarter of an edge.
NOISE_RATIO_MAX = (32.0 / 6.0 / 4.0) ** 2 / ROUNDING_VARIANCE
# The same of edges with times: the slots are cut with a tolerance of 3 % of the pitch.
SLOT_VARIANCE = 12.0 * ROUNDING_VARIANCE * 0.03**2
SLOPE_MAX = 0.3  # of the mean speed in all spans; a faster change is not smooth enough
# Successive deviations have four of five spans in common: so many are worth one independent one.
DEVIATIONS_PER_SAMPLE = 2.9
# Shares of faults that an encoder may have, and their probability before anything was counted.
FAULTY = 0.06
SHARES = (
    (0.003, 0.15),
    (0.006, 0.15),
    (0.0125, 0.15),
    (0.025, 0.2),
    (0.035, 0.1),
    (0.05, 0.1),
    (0.07, 0.07),
    (0.1, 0.05),
    (0.2, 0.03),
)
# The remaining variance without faults, relative to that of rounding: a motor turns unevenly, and
# at a rate near a whole number and a half every second count is rounded up. With probabilities.
UNEVENNESS = ((1.0, 0.99), (2.0, 0.01))
DEVIATIONS_MIN = 8  # before a fault is told
# By which the remaining variance differs from what rounding can cause, for a fault to be told, in
# standard errors: one strange count is none. Successive deviations have four of five spans in
# common, so that the true error is some 1.7 times larger.
CERTAIN_ERRORS_MIN = 5.0
SHARE_REPORTED = 0.004
HYPOTHESES = tuple(
    (factor, share, log(likely * probability))
    for factor, likely in UNEVENNESS
    for share, probability in ((0.0, 1.0 - FAULTY), *((at, FAULTY * part) for at, part in SHARES))
)
SHARE_UNKNOWN = sqrt(FAULTY * sum(share * share * part for share, part in SHARES))


class CountFaults:
    """Share of missed or additional edges of one encoder."""

    def __init__(self, has_edge_times: bool) -> None:
        self.noise = SLOT_VARIANCE if has_edge_times else ROUNDING_VARIANCE
        self.rates: list[tuple[float, int]] = []  # edges/s and edges of the last spans
        self.direction = 0
        self.seconds = 0.0
        self.edges = self.frames = 0
        self.first_edges = self.first_frames = 0
        self.number = 0
        self.sum_edges = self.sum_squares = self.sum_fourths = 0.0
        self.share = SHARE_UNKNOWN
        """standard deviation: missed or additional edges per edge"""
        self.is_certain = False

    def add(self, seconds: float, edges: int, direction: int) -> None:
        """Take `edges` counted during `seconds` into account; direction 0: it is not known."""
        if direction != self.direction:
            self.direction = direction
            self._restart()
            return
        self.seconds += seconds
        self.edges += edges
        self.frames += 1
        if not direction or not self._is_span_complete():
            return
        is_even = SPAN_EDGES_MIN <= self.edges <= SPAN_EDGES_RATIO_MAX * self.first_edges
        if not is_even or self.seconds > SPAN_SECONDS_MAX:
            self._restart()
            return
        if not self.rates:
            self.first_frames = self.frames
        self.rates.append((self.edges / self.seconds, self.edges))
        self.seconds, self.edges, self.frames = 0.0, 0, 0
        if len(self.rates) > len(WEIGHTS):
            del self.rates[0]
        if len(self.rates) == len(WEIGHTS):
            self._add_deviation()

    def _is_span_complete(self) -> bool:
        if self.seconds <= 0.0:
            return False
        if self.rates:
            return self.frames >= self.first_frames
        self.first_edges = self.edges
        return self.edges >= FIRST_EDGES_MIN

    def _restart(self) -> None:
        self.rates.clear()
        self.seconds, self.edges, self.frames = 0.0, 0, 0

    def _add_deviation(self) -> None:
        rates = [rate for rate, _ in self.rates]
        number = len(rates)
        mean = sum(rates) / number
        # The slope of a straight line through five points (least squares).
        slope = (2.0 * (rates[4] - rates[0]) + rates[3] - rates[1]) / 10.0
        if abs(slope) * number > SLOPE_MAX * mean:
            return
        edges = sum(edges for _, edges in self.rates) / number
        square = (edges / mean * sum(map(mul, WEIGHTS, rates))) ** 2
        self.number += 1
        self.sum_edges += edges
        self.sum_squares += square
        self.sum_fourths += square * square
        self._weigh()

    def _weigh(self) -> None:
        """Probability of each hypothesis: the deviations are normal with its variance."""
        samples = self.number / DEVIATIONS_PER_SAMPLE
        edges, square = self.sum_edges / self.number, self.sum_squares / self.number
        logs = []
        for unevenness, share, prior in HYPOTHESES:
            variance = unevenness * self.noise + SQUARES * edges * share
            logs.append(prior - 0.5 * samples * (log(variance) + square / variance))
        best = max(logs)
        total = mean_square = 0.0
        for (_, share, _), value in zip(HYPOTHESES, logs, strict=True):
            weight = exp(value - best)
            total += weight
            mean_square += weight * share * share
        self.share = sqrt(mean_square / total)
        excess = self.sum_squares - NOISE_RATIO_MAX * self.noise * self.number
        error = sqrt(max(self.sum_fourths - self.sum_squares**2 / self.number, 0.0))
        is_enough = self.number >= DEVIATIONS_MIN
        self.is_certain = is_enough and excess > CERTAIN_ERRORS_MIN * error

    @property
    def shown_share(self) -> float:
        """The share without what is only not known: what the counts show."""
        return sqrt(max(self.share**2 - SHARE_UNKNOWN**2, 0.0))

    @property
    def text(self) -> str:
        """What is wrong with the encoder, or an empty text."""
        if self.share < SHARE_REPORTED or not self.is_certain:
            return ""
        return f"edges are missing or counted twice: about {100.0 * self.share:.1f} %"
