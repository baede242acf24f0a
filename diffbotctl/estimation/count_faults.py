"""Faults of a fine encoder, from the regularity of its counts.

The speed of a wheel changes smoothly; a missed or an additional edge changes a count at once. The
fourth difference of the counts in successive spans of time removes the smooth part: a wheel turns
too steadily for anything else to remain than the faults and the rounding to whole edges. The
variance that remains for each edge is the share of faults (variance of a Poisson process).

Rounding depends on the rate: at nearly a whole number of edges in a span all counts are equal, at a
whole number and a half every second one is rounded up. One variance for all rates would hide faults
at the first, and take the second for faults. With faults the edges have another rate than the
counts, which each hypothesis takes into account.

Whether edges were missing or counted twice would follow from the third moment, but on the few
hundred spans of a drive its sign is too uncertain: a wrong correction of one wheel turned simulated
robots by 30 degrees. So the share is taken as a standard deviation of the travel: the root of its
mean square over what the share may be, since on a short drive no counts rule a few faults out.
"""

from __future__ import annotations

from itertools import pairwise
from math import exp, log, sqrt
from operator import mul
from typing import NamedTuple

from diffbotctl.estimation.likelihood import normal_density
from diffbotctl.estimation.timed_fault_shares import TimedFaultShares

# The first span has so many edges, as rounding hides faults in shorter ones, fewer where edges come
# slowly, and very few where they have times. The next ones have as many frames, so that rounding is
# not favoured in one direction, until their edges leave the limits.
FIRST_EDGES_MIN, SLOW_FIRST_EDGES_MIN, FIRST_SECONDS_MAX = 16, 8, 0.1
SPAN_EDGES_MIN, SPAN_EDGES_RATIO_MAX = 5, 2.5
TIMED_FIRST_EDGES_MIN, TIMED_SPAN_EDGES_MIN = 3, 1
SPAN_SECONDS_MAX = 0.3
WEIGHTS = (1.0 / 6.0, -4.0 / 6.0, 1.0, -4.0 / 6.0, 1.0 / 6.0)
SQUARES = sum(weight**2 for weight in WEIGHTS)
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
EDGES_GAIN, EDGES_CHANGE_MAX = 0.3, 1.0
RATE_SD = 0.1  # edges in a span; of the rate that is taken from five counts
# The same of edges with times: the slots are cut with a tolerance of 3 % of the pitch, and the
# squared differences of successive weights add up to 7.
SLOT_VARIANCE = 7.0 * 0.03**2
SLOPE_MAX = 0.3  # of the mean speed in all spans; a faster change is not smooth enough
# Without edge times, the rounding of the count at the end of a span hides much. Spans that end at
# other frames are rounded otherwise: so many series of spans, each begun after so many edges.
OFFSETS, OFFSET_EDGES = 4, 4
# Successive deviations have four of five spans in common, and those of several series nearly all:
# so many are worth one independent one, for each number of series.
DEVIATIONS_PER_SAMPLE = (2.9, 2.9, 4.1, 5.1, 5.8)
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
# Standard deviation of the mean speed in a span, relative to the speed, by which a motor turns
# unevenly: gears, commutator and the loop of the board. With probabilities.
UNEVENNESS = ((0.0, 0.6), (0.003, 0.25), (0.006, 0.15))
# Share of the deviations in which the motion itself was not smooth, such as at a start or a seam of
# the floor, and the change of the speed then, relative to it.
ROUGH_SHARE, ROUGH_CHANGE = 0.01, 0.1
DEVIATIONS_MIN = 8  # before a fault is told
# By which the remaining variance differs from what rounding causes, for a fault to be told, in
# standard errors: one strange count is none. Successive deviations have four of five spans in
# common, so that the true error is some 1.7 times larger.
CERTAIN_ERRORS_MIN = 5.0
SHARE_REPORTED = 0.004
# Unevenness, signed share (of additional edges; of missing ones if negative) and log probability.
HYPOTHESES = (
    *((uneven, 0.0, log(likely * (1.0 - FAULTY))) for uneven, likely in UNEVENNESS),
    *(
        (0.0, sign * share, log(0.5 * FAULTY * part))
        for share, part in SHARES
        for sign in (-1.0, 1.0)
    ),
)
# Factor of the variance by rounding that an uneven motor explains, before a fault is told.
UNEVEN_MAX = 2.0
FAULTY_MIN = 0.9  # probability of faults, of a fine encoder with edge times, for them to be told
SHARE_UNKNOWN = sqrt(FAULTY * sum(share * share * part for share, part in SHARES))


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

    def __init__(self, has_edge_times: bool, may_be_short: bool) -> None:
        self.has_edge_times, self.may_be_short = has_edge_times, may_be_short
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
        least = TIMED_SPAN_EDGES_MIN if self.may_be_short else SPAN_EDGES_MIN
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
        if self.may_be_short:
            return self.edges >= TIMED_FIRST_EDGES_MIN
        is_slow = self.has_edge_times or self.seconds >= FIRST_SECONDS_MAX
        return self.edges >= (SLOW_FIRST_EDGES_MIN if is_slow else FIRST_EDGES_MIN)

    def _deviation(self) -> Deviation | None:
        rates = [rate for rate, _ in self.rates]
        number = len(rates)
        mean = sum(rates, 0.0) / number
        # The slope of a straight line through five points (least squares).
        slope = (2.0 * (rates[4] - rates[0]) + rates[3] - rates[1]) / 10.0
        if abs(slope) * number > SLOPE_MAX * mean:
            return None
        edges = sum(edges for _, edges in self.rates) / number
        scale = edges / mean  # seconds of a span
        square = (scale * sum(map(mul, WEIGHTS, rates), 0.0)) ** 2
        self.number += 1
        # The rate of many spans: an edge in excess also changes the rate of its own ones.
        predicted = self.edges_mean + slope * scale
        is_new = self.number == 1 or abs(edges - predicted) > EDGES_CHANGE_MAX
        self.edges_mean = edges if is_new else predicted + EDGES_GAIN * (edges - predicted)
        return Deviation(square, self.edges_mean, slope * scale)


class CountFaults:
    """Share of missed or additional edges of one encoder."""

    def __init__(self, has_edge_times: bool, is_fine: bool = True) -> None:
        """`is_fine`: edges come so densely that the speed changes little in the time of fifteen."""
        self.has_edge_times = has_edge_times
        may_be_short = has_edge_times and is_fine
        offsets = 1 if has_edge_times else OFFSETS
        self.spans = [CountSpans(has_edge_times, may_be_short) for _ in range(offsets)]
        self.begun = 0  # of them, since the direction has changed
        self.direction = 0
        self.edges = 0  # since then
        self.number = 0
        self.sum_squares = self.sum_fourths = 0.0
        self.sum_noise = 0.0
        self.logs = [prior for _, _, prior in HYPOTHESES]
        self.timed = (
            TimedFaultShares(WEIGHTS, FAULTY, SHARES, SLOT_VARIANCE) if may_be_short else None
        )
        self.share = SHARE_UNKNOWN
        """standard deviation: missed or additional edges per edge"""
        self.is_certain = False

    def add(self, seconds: float, edges: int, direction: int) -> None:
        """Take `edges` counted during `seconds` into account; direction 0: it is not known."""
        if direction != self.direction:
            self.direction = direction
            self._restart()
            return
        if not direction:
            return
        spans, begun = self.spans, self.begun
        # Those that begin a frame later than the others before, within the first span.
        if begun < len(spans) and self.edges >= begun * OFFSET_EDGES and self.is_in_first_span:
            self.begun = begun = begun + 1
        self.edges += edges
        for index in range(begun):
            deviation = spans[index].add(seconds, edges)
            if deviation is not None:
                if index == 0:
                    self._sum(deviation)
                self._weigh(deviation, DEVIATIONS_PER_SAMPLE[begun])

    @property
    def is_in_first_span(self) -> bool:
        """Whether the first spans are not complete."""
        return not self.spans[0].rates

    def _restart(self) -> None:
        self.begun = self.edges = 0
        for spans in self.spans:
            spans.restart()

    def _sum(self, deviation: Deviation) -> None:
        square = deviation.square
        self.number += 1
        self.sum_squares += square
        self.sum_fourths += square * square
        self.sum_noise += self._noise(deviation.edges, deviation.slope)
        excess = self.sum_squares - UNEVEN_MAX * self.sum_noise
        error = sqrt(max(self.sum_fourths - self.sum_squares**2 / self.number, 0.0))
        is_enough = self.number >= DEVIATIONS_MIN
        is_probable = self.timed is None or self.timed.probability > FAULTY_MIN
        self.is_certain = is_enough and is_probable and excess > CERTAIN_ERRORS_MIN * error

    def _noise(self, edges: float, slope: float) -> float:
        """Variance without faults of five successive counts: `edges` on average, `slope` more in
        each."""
        if self.has_edge_times:
            return SLOT_VARIANCE
        low = round(RATES * (edges - SLOPE_SD * slope))
        high = round(RATES * (edges + SLOPE_SD * slope))
        return 0.5 * (ROUNDING_NOISE[low % RATES] + ROUNDING_NOISE[high % RATES])

    def _weigh(self, deviation: Deviation, deviations_per_sample: float) -> None:
        """Probability of each hypothesis. The deviations are normal with its variance; few faults
        are in few of them only, in any of five spans, and then each is a whole edge."""
        square, edges, slope = deviation
        rough = self._noise(edges, slope) + (ROUGH_CHANGE * edges) ** 2
        other = ROUGH_SHARE * normal_density(square, rough)
        if self.timed is not None:
            self.timed.add(square, edges, other, 1.0 / deviations_per_sample)
            self.share = sqrt(self.timed.mean_square)
            return
        for index, (uneven, share, _) in enumerate(HYPOTHESES):
            noise = self._noise(edges * (1.0 - share), slope) + SQUARES * (uneven * edges) ** 2
            likely = normal_density(square, noise)
            if share:
                faults = edges * abs(share)
                affected = 1.0 - exp(-len(WEIGHTS) * faults)
                with_faults = normal_density(square, noise + SQUARES * faults / affected)
                likely += affected * (with_faults - likely)
            self.logs[index] += log(other + (1.0 - ROUGH_SHARE) * likely) / deviations_per_sample
        best = max(self.logs)
        total = mean_square = 0.0
        for (_, share, _), value in zip(HYPOTHESES, self.logs, strict=True):
            weight = exp(value - best)
            total += weight
            mean_square += weight * share * share
        self.share = sqrt(mean_square / total)

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
