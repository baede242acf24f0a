"""Edges that begin or cease to be lost, from a rate that halves or doubles at once.

An encoder that loses every second slot from one moment on counts half of the rate before; one that
works again counts twice. No motor does that to its wheel: its speed follows within its lag, and a
load that slows it down goes on to do so. What a motor explains does not matter for it, nor how far
its curve is known. A fine encoder shows it within two or three frames. Times are seconds.
"""

from __future__ import annotations

from collections import deque
from math import log, sqrt
from typing import NamedTuple

LOG_TWO = log(2.0)
# Steady motion before the step; the longest time in which the edges after it are counted, twice.
BEFORE_S, BEFORE_MIN_S, AFTER_S = 0.2, 0.14, 0.08
BEFORE_SPANS_MIN = 4
# Edges after a step, twice, and in each half of the time before it.
EDGES_MIN, TIMED_EDGES_MIN = 5, 6
COMMAND_RATIO_MAX = 1.6  # of the greatest and the smallest command meanwhile
# Logarithms of ratios: of both halves of the time before; of the rate before and the commanded one,
# which a wheel at its limit does not reach, and one whose edges are lost often does not.
TREND_MAX, ABOVE_MAX, BELOW_MAX, BELOW_LOST_MAX = 0.2, 0.3, 0.3, 0.9
# Standard deviations: of a count by rounding, or by the cut of the slots with edge times, in edges;
# of the logarithm of a rate by the motion.
ROUNDING_SD, SLOT_SD, MOTION_SD = 0.41, 0.07, 0.05
RATE_SD_MAX = 0.2  # of the logarithm of the step; above it nothing is told
# Logarithm of the step against the rate just before: what extrapolation adds to it is uncertain.
UNEXTRAPOLATED_MIN = 0.5
STEP_SDS = 2.0  # by which a step may differ from a factor of two
# The same logarithm for the edges after those: the board's loop drives a wheel whose edges are lost
# faster, and one that shows all of them again slower; a load slows its wheel down further.
LOST_AFTER, FOUND_AFTER = (-0.85, -0.35), (0.2, 0.85)
FURTHER_MAX = 0.1
# That the edges were lost. One of 100 simulated runs without such a fault has such a step, nearly
# always by edges that are lost otherwise, or by a load that sets in. An encoder fails as rarely.
PROBABILITY = 0.25
LOST_TEXT = (
    "its edges came at half the rate from one moment to the next: every second one is missing, or "
    "something held the wheel"
)
FOUND_TEXT = (
    "its edges came at twice the rate from one moment to the next: every second one was missing "
    "before, or each is counted twice since"
)


class Span(NamedTuple):
    """Edges that came within a time, and the commanded rate, edges/s."""

    seconds: float
    edges: int
    commanded: float


class RateSteps:
    """Steps of one wheel's rate of edges."""

    def __init__(self, has_edge_times: bool) -> None:
        self.edges_min = TIMED_EDGES_MIN if has_edge_times else EDGES_MIN
        self.count_sd = SLOT_SD if has_edge_times else ROUNDING_SD
        self.spans: deque[Span] = deque(maxlen=64)
        self.seconds = 0.0  # without an edge
        self.text = ""
        """what was seen since the pose was set, or an empty text"""

    @property
    def probability(self) -> float:
        """That edges have been lost, or counted twice, since the pose was set."""
        return PROBABILITY if self.text else 0.0

    @property
    def share(self) -> float:
        """Standard deviation of the travel by it, relative to the travel."""
        return sqrt(self.probability)

    def pose_is_set(self) -> None:
        """What happened before does not matter any more."""
        self.text = ""

    def restart(self) -> None:
        """The wheel is not driven, or was reversed."""
        self.spans.clear()
        self.seconds = 0.0

    def add(self, seconds: float, edges: int, commanded: float) -> None:
        """Take `edges` in the `seconds` since the edges before, or since the frame before, with the
        rate that the command demands (edges/s)."""
        self.seconds += seconds
        if not edges:
            return
        self.spans.append(Span(self.seconds, edges, abs(commanded)))
        self.seconds = 0.0
        if len(self.spans) > BEFORE_SPANS_MIN + 2:
            self.text = self._seen() or self.text

    def _seen(self) -> str:
        spans = list(self.spans)
        last = self._taken(spans)
        first = self._taken(spans)
        if last is None or first is None or not spans:
            return ""
        change = spans.pop()
        before = _recent(spans, BEFORE_S)
        half = len(before) // 2
        if len(before) < BEFORE_SPANS_MIN or change.commanded <= 0.0:
            return ""
        commands = [span.commanded for span in (*before, change, first, last)]
        if max(commands) > COMMAND_RATIO_MAX * min(commands):
            return ""
        early, late = _sum(before[:half]), _sum(before[half:])
        if min(early.edges, late.edges) < self.edges_min:
            return ""
        if early.seconds + late.seconds < BEFORE_MIN_S:
            return ""
        return self._compared(early, late, change, first, last)

    def _taken(self, spans: list[Span]) -> Span | None:
        """The last of `spans` with enough edges, which are removed; None if they took too long."""
        taken: list[Span] = []
        while spans and sum((span.edges for span in taken), 0) < self.edges_min:
            taken.append(spans.pop())
        whole = _sum(taken)
        is_enough = whole.edges >= self.edges_min
        return whole if is_enough and whole.seconds <= AFTER_S + taken[-1].seconds else None

    def _compared(self, early: Span, late: Span, change: Span, first: Span, last: Span) -> str:
        early_rate, rate = early.edges / early.seconds, late.edges / late.seconds
        trend, level = log(rate / early_rate), log(rate / change.commanded)
        if abs(trend) > TREND_MAX or not -BELOW_LOST_MAX <= level <= ABOVE_MAX:
            return ""
        # Steps of the rate from the early to the late half, until the edges after the step.
        apart = 0.5 * (early.seconds + late.seconds)
        ahead = (0.5 * late.seconds + change.seconds + 0.5 * first.seconds) / apart
        change_of_rate = rate - early_rate
        step = _log_ratio(first, rate + change_of_rate * ahead, rate)
        if abs(_log_ratio(first, rate, rate)) < UNEXTRAPOLATED_MIN:
            return ""
        further = ahead + 0.5 * (first.seconds + last.seconds) / apart
        after = _log_ratio(last, rate + change_of_rate * further, rate)
        sd = sqrt(
            ((1.0 + ahead) * self.count_sd / late.edges) ** 2
            + (ahead * self.count_sd / early.edges) ** 2
            + (self.count_sd / first.edges) ** 2
            + MOTION_SD * MOTION_SD
        )
        if sd > RATE_SD_MAX:
            return ""
        if abs(step + LOG_TWO) < STEP_SDS * sd and level > -BELOW_MAX:
            low, high = LOST_AFTER
            is_lost = low - sd < after < high and after > step - FURTHER_MAX - sd
            return LOST_TEXT if is_lost else ""
        low, high = FOUND_AFTER
        is_found = abs(step - LOG_TWO) < STEP_SDS * sd and low < after < high + sd
        return FOUND_TEXT if is_found else ""


def _sum(spans: list[Span]) -> Span:
    seconds = sum((span.seconds for span in spans), 0.0)
    return Span(
        seconds, sum((span.edges for span in spans), 0), spans[0].commanded if spans else 0.0
    )


def _recent(spans: list[Span], seconds: float) -> list[Span]:
    """The last of `spans` that take `seconds`."""
    taken: list[Span] = []
    total = 0.0
    while spans and total < seconds:
        taken.append(spans.pop())
        total += taken[-1].seconds
    return taken[::-1]


def _log_ratio(span: Span, predicted: float, rate: float) -> float:
    """Logarithm of the rate of `span` over the predicted one, which is half of `rate` or more."""
    return log(span.edges / span.seconds / max(predicted, 0.5 * rate))
