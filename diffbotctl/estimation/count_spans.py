"""Successive spans of time and the edges in them, and what is uneven in five of them."""

from __future__ import annotations

from itertools import pairwise
from operator import mul
from typing import NamedTuple

# The first span has so many edges, as rounding hides faults in shorter ones, fewer where edges come
# slowly, and very few where they have times. The next ones have as many frames, so that rounding is
# not favoured in one direction, until their edges leave the limits.
FIRST_EDGES_MIN, SLOW_FIRST_EDGES_MIN, FIRST_SECONDS_MAX = 16, 8, 0.1
SPAN_EDGES_MIN, SPAN_EDGES_RATIO_MAX = 5, 2.5
TIMED_FIRST_EDGES_MIN, TIMED_SPAN_EDGES_MIN = 3, 1
SPAN_SECONDS_MAX = 0.3
WEIGHTS = (1.0 / 6.0, -4.0 / 6.0, 1.0, -4.0 / 6.0, 1.0 / 6.0)
SQUARES = sum((weight**2 for weight in WEIGHTS), 0.0)
# The same of an error at the boundary of two spans, which adds to one what it takes from the other.
BOUNDARY_SQUARES = sum(
    ((after - before) ** 2 for before, after in pairwise((0.0, *WEIGHTS, 0.0))), 0.0
)
EDGES_GAIN, EDGES_CHANGE_MAX = 0.3, 1.0
SLOPE_MAX = 0.3  # of the mean speed in all spans; a faster change is not smooth enough


class Deviation(NamedTuple):
    """What five successive spans show."""

    square: float
    """fourth difference of their edges, squared"""
    edges: float
    """in a span, on average"""
    slope: float
    """edges by which a span has more than the one before"""


class CountSpans:
    """Successive spans of time, and the edges in them."""

    def __init__(self, has_edge_times: bool) -> None:
        self.has_edge_times = has_edge_times
        self.rates: list[tuple[float, int]] = []  # edges/s and edges of the last spans
        self.seconds = 0.0
        self.edges = self.frames = 0
        self.first_edges = self.first_frames = 0
        self.number = 0
        self.edges_mean = 0.0  # in a span

    def restart(self) -> None:
        """Begin with the next frame."""
        self.rates.clear()
        self.seconds, self.edges, self.frames = 0.0, 0, 0

    def add(self, seconds: float, edges: int) -> Deviation | None:
        """Take the `edges` of a frame; a deviation when five spans are complete."""
        self.seconds += seconds
        self.edges += edges
        self.frames += 1
        if not self._is_span_complete():
            return None
        least = TIMED_SPAN_EDGES_MIN if self.has_edge_times else SPAN_EDGES_MIN
        is_even = least <= self.edges <= SPAN_EDGES_RATIO_MAX * self.first_edges
        if not is_even or self.seconds > SPAN_SECONDS_MAX:
            self.restart()
            return None
        if not self.rates:
            self.first_frames = self.frames
        self.rates.append((self.edges / self.seconds, self.edges))
        self.seconds, self.edges, self.frames = 0.0, 0, 0
        if len(self.rates) > len(WEIGHTS):
            del self.rates[0]
        return self._deviation() if len(self.rates) == len(WEIGHTS) else None

    def _is_span_complete(self) -> bool:
        if self.seconds <= 0.0:
            return False
        if self.rates:
            return self.frames >= self.first_frames
        self.first_edges = self.edges
        if self.has_edge_times:
            return self.edges >= TIMED_FIRST_EDGES_MIN
        is_slow = self.seconds >= FIRST_SECONDS_MAX
        return self.edges >= (SLOW_FIRST_EDGES_MIN if is_slow else FIRST_EDGES_MIN)

    def _deviation(self) -> Deviation | None:
        rates = [rate for rate, _ in self.rates]
        number = len(rates)
        mean = sum(rates, 0.0) / number
        # The slope of a straight line through five points (least squares).
        slope = (2.0 * (rates[4] - rates[0]) + rates[3] - rates[1]) / 10.0
        if abs(slope) * number > SLOPE_MAX * mean:
            return None
        edges = sum((edges for _, edges in self.rates), 0) / number
        scale = edges / mean  # seconds of a span
        square = (scale * sum(map(mul, WEIGHTS, rates), 0.0)) ** 2
        self.number += 1
        # The rate of many spans: an edge in excess also changes the rate of its own ones.
        predicted = self.edges_mean + slope * scale
        is_new = self.number == 1 or abs(edges - predicted) > EDGES_CHANGE_MAX
        self.edges_mean = edges if is_new else predicted + EDGES_GAIN * (edges - predicted)
        return Deviation(square, self.edges_mean, slope * scale)
