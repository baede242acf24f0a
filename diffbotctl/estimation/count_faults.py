"""Faults of a fine encoder, from the regularity of its counts.

The speed of a wheel changes smoothly; a missed or an additional edge changes a count at once. The
fourth difference of the counts in successive spans of time removes the smooth part: a wheel turns
too steadily for anything else to remain than the faults and the rounding to whole edges. The
variance that remains for each edge is the share of faults (variance of a Poisson process).

Whether edges were missing or counted twice would follow from the third moment, but on the few
hundred spans of a drive its sign is too uncertain: a wrong correction of one wheel turned simulated
robots by 30 degrees. So the share is taken as a standard deviation of the travel.
"""

from __future__ import annotations

from math import sqrt
from operator import mul

# The first span has so many edges; the next ones have as many frames, so that rounding is not
# favoured in one direction, until their edges leave the limits.
FIRST_EDGES_MIN = 8
SPAN_EDGES_MIN, SPAN_EDGES_RATIO_MAX = 5, 2.5
SPAN_SECONDS_MAX = 0.2  # in a longer time a speed changes too much
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
ROUNDING_VARIANCE_MAX = (32.0 / 6.0 / 4.0) ** 2
# The same of edges with times: the slots are cut with a tolerance of 3 % of the pitch.
SLOT_VARIANCE = 12.0 * ROUNDING_VARIANCE * 0.03**2
SLOPE_MAX = 0.3  # of the mean speed in all spans; a faster change is not smooth enough
DEVIATIONS_MIN = 8  # before anything is concluded
# By which the share differs from zero, to be taken into account and to be told. Successive
# deviations have four of five spans in common, so that the true error is some 1.7 times larger.
STANDARD_ERRORS_MIN, CERTAIN_ERRORS_MIN = 2.0, 5.0
SHARE_MAX = 0.3  # above it counts are no measurement any more
SHARE_REPORTED = 0.004


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
        self.share = 0.0
        """missed or additional edges per edge; 0 unless the counts make it likely"""
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
        if self.number >= DEVIATIONS_MIN:
            excess = self.sum_squares - self.noise * self.number
            error = sqrt(max(self.sum_fourths - self.sum_squares**2 / self.number, 0.0))
            is_likely = excess > STANDARD_ERRORS_MIN * error
            bias = 0.0 if self.noise < ROUNDING_VARIANCE else ROUNDING_VARIANCE_MAX - self.noise
            self.is_certain = excess > CERTAIN_ERRORS_MIN * error + bias * self.number
            self.share = min(excess / (SQUARES * self.sum_edges), SHARE_MAX) if is_likely else 0.0

    @property
    def text(self) -> str:
        """What is wrong with the encoder, or an empty text."""
        if self.share < SHARE_REPORTED or not self.is_certain:
            return ""
        return f"edges are missing or counted twice: about {100.0 * self.share:.1f} %"
