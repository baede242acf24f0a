"""Share of the edges that a fine encoder misses or counts twice, from the regularity of its counts.

The speed of a wheel changes smoothly; a missed or an additional edge changes a count at once. The
fourth difference of the counts in five successive spans removes the smooth part. What remains is
the rounding to whole edges, or the cut of the slots where edges have times, an uneven motor, and
the faults: their variance for each edge is their share (Poisson process).

Whether edges were missing or counted twice would follow from the third moment, but on the few
hundred spans of a drive its sign is too uncertain. So the share is taken as a standard deviation of
the travel: the root of its mean square over what it may be, since on a short drive no counts rule a
few faults out.
"""

from __future__ import annotations

import sys
from collections import Counter
from itertools import pairwise
from math import exp, log, sqrt
from operator import mul
from typing import NamedTuple

from diffbotctl.estimation.wheel_kalman import normal_density

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

    square: float  # fourth difference of their edges, squared
    edges: float  # in a span, on average
    slope: float  # edges by which a span has more than the one before


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


# Probability of faults and of each share, before anything was counted.
FAULTY = 0.06
SHARES = (
    (0.003, 0.15),
    (0.006, 0.15),
    (0.0125, 0.15),
    (0.025, 0.2),
    (0.05, 0.2),
    (0.1, 0.12),
    (0.2, 0.03),
)
# Standard deviation of the mean speed in a span, relative to the speed, by which a motor turns
# unevenly, with probabilities: gears, commutator and the loop of the board. Where edges have times,
# spans are so short that a gear shows that cogs by 5 % of the stall torque: it reaches 0.1 where
# the motor has hardly more torque than friction takes.
UNEVENNESS = (0.0, 0.6), (0.003, 0.25), (0.006, 0.15)
TIMED_UNEVENNESS = (0.0, 0.45), (0.006, 0.25), (0.025, 0.15), (0.05, 0.08), (0.1, 0.05), (0.2, 0.02)
# A gear swings evenly, within limits, and never by a whole edge at once: a sine with the standard
# deviation 1 takes the middles of its four quarters by value for equal times, and the values
# scatter by about a quarter around each. It shows from SINE_MIN times the usual variance on.
SINE_VALUES, SINE_SPREAD, SINE_MIN = (-1.307, -0.541, 0.541, 1.307), 0.0625, 4.0
# What a single fault in one of five spans adds to the fourth difference, with probabilities.
SINGLE_FAULTS = tuple(
    (sign * weight, count / (2.0 * len(WEIGHTS)))
    for weight, count in Counter(WEIGHTS).items()
    for sign in (-1.0, 1.0)
)
# Share of the deviations in which the motion itself was not smooth, such as at a start or a seam of
# the floor, and the change of the speed then, relative to it.
ROUGH_SHARE, ROUGH_CHANGE = 0.01, 0.1
SLOT_SD = 0.03  # pitches; cut of the slots, of edges with times
RATE_VARIANCE = 0.02  # edges2 in a span; of the rate that is taken from five counts
# Of the fourth difference by rounding, at a whole number of edges and a half in a span.
ROUNDING_VARIANCE_MAX = 16.0 / 9.0
# Successive deviations have four of five spans in common: every third one is taken, and so many of
# those are worth one independent one.
DEVIATIONS_TAKEN, DEVIATIONS_PER_SAMPLE = 3, 1.3
FAULTY_MIN, SHARE_MIN = 0.95, 0.004  # probability and share from which on faults are reported
HIDDEN_SHARE = 0.003  # of one encoder more than of the other, where the jitter of frames hides it


class CountFaults:
    """Share of missed or additional edges of one encoder."""

    def __init__(self, has_edge_times: bool, is_hidden: bool = False) -> None:
        """`is_hidden`: the times of frames are filtered, so that regular counts prove nothing."""
        self.has_edge_times = has_edge_times
        self.is_hidden = is_hidden
        self.spans = CountSpans(has_edge_times)
        self.direction = 0
        self.unevenness = TIMED_UNEVENNESS if has_edge_times else UNEVENNESS
        self.shares = ((0.0, 1.0 - FAULTY), *((share, FAULTY * part) for share, part in SHARES))
        self.logs = [log(likely * part) for _, likely in self.unevenness for _, part in self.shares]
        self.probability = FAULTY
        """that there are faults"""
        self.share = sqrt(FAULTY * sum((share * share * part for share, part in SHARES), 0.0))
        """standard deviation: missed or additional edges per edge"""
        if is_hidden:
            self.share = HIDDEN_SHARE

    def add(self, seconds: float, edges: int, direction: int) -> None:
        """Take `edges` counted during `seconds` into account; direction 0: it is not known."""
        if self.is_hidden:
            return
        if direction != self.direction:
            self.direction = direction
            self.spans.restart()
        elif direction:
            deviation = self.spans.add(seconds, edges)
            if deviation is not None and self.spans.number % DEVIATIONS_TAKEN == 0:
                self._take(deviation)

    @property
    def text(self) -> str:
        """What is wrong with the encoder, or an empty text."""
        if self.share < SHARE_MIN or self.probability < FAULTY_MIN:
            return ""
        return f"edges are missing or counted twice: about {100.0 * self.share:.1f} %"

    def _take(self, deviation: Deviation) -> None:
        square, edges, slope = deviation
        usual = self._noise(edges, slope)
        # Above 0: interference at a wheel that stands gives edges that nothing explains.
        density = normal_density(square, usual + (ROUGH_CHANGE * edges) ** 2)
        rough = ROUGH_SHARE * max(density, sys.float_info.min)
        size, parts = sqrt(square), [_faults_in(edges * share) for share, _ in self.shares]
        index = 0
        for uneven, _ in self.unevenness:
            motion = SQUARES * (uneven * edges) ** 2
            noise = usual + motion
            none = _density(size, usual, motion)
            one = 0.0
            for value, part in SINGLE_FAULTS:
                one += part * _density(size - value, usual, motion)
            for no_fault, one_fault, more, variance in parts:
                likely = no_fault * none + one_fault * one
                if more:
                    likely += more * normal_density(square, noise + variance)
                likely = rough + (1.0 - ROUGH_SHARE) * likely
                self.logs[index] += log(likely) / DEVIATIONS_PER_SAMPLE
                index += 1
        self._weigh()

    def _noise(self, edges: float, slope: float) -> float:
        """Variance without faults, of spans with `edges` on average and `slope` more in each."""
        if self.has_edge_times:
            return BOUNDARY_SQUARES * SLOT_SD * SLOT_SD
        first, last = edges - 1.4 * slope, edges + 1.4 * slope  # five numbers have this deviation
        return 0.5 * (_rounding_variance(first) + _rounding_variance(last))

    def _weigh(self) -> None:
        best = max(self.logs)
        total = faulty = mean_square = 0.0
        number = len(self.shares)
        for index, value in enumerate(self.logs):
            share = self.shares[index % number][0]
            weight = exp(value - best)
            total += weight
            if share:
                faulty += weight
                mean_square += weight * share * share
        self.probability, self.share = faulty / total, sqrt(mean_square / total)


def _rounding_variance(edges: float) -> float:
    """Variance of the fourth difference by rounding the counts of spans with so many `edges`.

    It grows from 0 at a whole number to 16/9 at a whole number and a half, nearly with the square
    of the distance from it: 7/18 at 0.2, 1/2 at 0.25, 1 at 0.4.
    """
    square = (edges - round(edges)) ** 2 + RATE_VARIANCE
    return ROUNDING_VARIANCE_MAX * min(4.0 * square, 1.0)


def _density(value: float, usual: float, motion: float) -> float:
    """Of a deviation with the variance `usual` and a motion with the variance `motion`."""
    if motion < SINE_MIN * usual:
        return normal_density(value * value, usual + motion)
    sd, variance = sqrt(motion), usual + SINE_SPREAD * motion
    densities = (normal_density((value - each * sd) ** 2, variance) for each in SINE_VALUES)
    return sum(densities, 0.0) / len(SINE_VALUES)


def _faults_in(faults: float) -> tuple[float, float, float, float]:
    """Probabilities that five spans with `faults` in each on average have none, one and more (a
    Poisson distribution), and the variance that those add."""
    mean = len(WEIGHTS) * faults
    none = exp(-mean)
    one = mean * none
    more = 1.0 - none - one
    if more < 1e-9:
        return none, one, 0.0, 0.0
    return none, one, more, SQUARES / len(WEIGHTS) * (mean - one) / more
