"""Whether every second pulse of an encoder is missing, by the width of its pulses.

The pin has the counted level for half of a pitch after each edge, nearly. Where every second pulse
is missing, the counted edges are two pitches apart, and it has that level for a quarter or for
three quarters of the way between them, whichever level a pulse has. The board reports the level at
the times of its frames, and when the edge before came: how far the wheel has turned since then,
relative to the way between two edges, follows from the time if it turns evenly.
"""

from __future__ import annotations

from math import exp, log

# Shares of the way between two edges at which the level shows a missing pulse: it is that of a
# healthy disc, whose share is 0.5 with a standard deviation of 0.07, or that of a quarter, or of
# three quarters.
QUARTER, THREE_QUARTERS = (0.30, 0.38), (0.62, 0.70)
STEADY_RATIO = 1.2  # of two successive times between edges; in between the wheel turns evenly
LOG_RATIO = 2.0  # natural log of the ratio of the likelihoods by one level: one in eight is wrong
LOG_RATIO_MAX = 4.0  # all levels depend on the widths of the slots
FADE = exp(-1.0 / 6.0)  # of the weight of a level by each later one


class PulseWidth:
    """The levels of one pin that tell whether every second pulse is missing."""

    def __init__(self) -> None:
        self.quarter = self.three_quarters = 0.0  # natural logs of likelihood ratios
        self.lost_log_ratio = 0.0
        """natural log of the likelihood that every second pulse is missing, relative to none"""
        self.restart()

    def restart(self) -> None:
        """Go on after a gap in the frames."""
        self.edge: int | None = None  # ns
        self.count = 0
        self.interval = 0.0  # ns, between two edges
        self.is_steady = False

    def update(
        self, time: int, count: int, edge_time: int | None, has_counted_level: bool | None
    ) -> None:
        """Take a frame, with the level of the pin if it has it; times in ns."""
        if edge_time is None:
            return
        if edge_time != self.edge:
            self._take_edge(edge_time, count)
        if has_counted_level is None or not self.is_steady:
            return
        share = (time - edge_time) / self.interval
        if QUARTER[0] < share < QUARTER[1]:
            self.quarter = _added(self.quarter, not has_counted_level)
        elif THREE_QUARTERS[0] < share < THREE_QUARTERS[1]:
            self.three_quarters = _added(self.three_quarters, has_counted_level)
        else:
            return
        self.lost_log_ratio = log(0.5 * (exp(self.quarter) + exp(self.three_quarters)))

    def _take_edge(self, edge_time: int, count: int) -> None:
        before, edges = self.edge, abs(count - self.count)
        self.edge, self.count = edge_time, count
        interval, self.interval = self.interval, 0.0
        self.is_steady = False
        if before is None or not edges or edge_time <= before:
            return
        self.interval = (edge_time - before) / edges
        if interval:
            self.is_steady = 1.0 / STEADY_RATIO < self.interval / interval < STEADY_RATIO


def _added(ratio: float, is_lost: bool) -> float:
    ratio = FADE * ratio + (LOG_RATIO if is_lost else -LOG_RATIO)
    return min(max(ratio, -LOG_RATIO_MAX), LOG_RATIO_MAX)
