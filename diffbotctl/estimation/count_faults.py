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

from math import sqrt

from diffbotctl.estimation.count_fault_shares import CountFaultShares
from diffbotctl.estimation.count_spans import CountSpans, Deviation
from diffbotctl.estimation.fault_share_priors import SHARE_UNKNOWN
from diffbotctl.estimation.timed_fault_shares import TimedFaultShares

# Without edge times, the rounding of the count at the end of a span hides much. Spans that end at
# other frames are rounded otherwise: so many series of spans, each begun after so many edges.
OFFSETS, OFFSET_EDGES = 4, 4
# Successive deviations have four of five spans in common, and those of several series nearly all:
# so many are worth one independent one, for each number of series.
DEVIATIONS_PER_SAMPLE = (2.9, 2.9, 4.1, 5.1, 5.8)
DEVIATIONS_MIN = 8  # before a fault is told
# By which the remaining variance differs from what rounding causes, for a fault to be told, in
# standard errors: one strange count is none. Successive deviations have four of five spans in
# common, so that the true error is some 1.7 times larger.
CERTAIN_ERRORS_MIN = 5.0
SHARE_REPORTED = 0.004
# Factor of the variance by rounding that an uneven motor explains, before a fault is told.
UNEVEN_MAX = 2.0


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
        self.shares = TimedFaultShares() if may_be_short else CountFaultShares(has_edge_times)
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
                self.shares.add(deviation, DEVIATIONS_PER_SAMPLE[begun])

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
        self.sum_noise += self.shares.noise(deviation.edges, deviation.slope)
        excess = self.sum_squares - UNEVEN_MAX * self.sum_noise
        error = sqrt(max(self.sum_fourths - self.sum_squares**2 / self.number, 0.0))
        is_enough = self.number >= DEVIATIONS_MIN
        is_clear = excess > CERTAIN_ERRORS_MIN * error
        self.is_certain = is_enough and self.shares.shows_faults and is_clear

    @property
    def share(self) -> float:
        """Standard deviation: missed or additional edges per edge."""
        return sqrt(self.shares.mean_square)

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
