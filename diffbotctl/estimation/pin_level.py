"""What the level of an encoder's pin shows: bounds on the angle of the wheel, and missing pulses.

An edge is counted where the pin goes to the counted level: forward at each whole z, backward at
each whole z plus the open share. So the pin has the counted level from each whole z to there.

Where every second pulse is missing, the counted edges are two pitches apart, and it has that level
for a quarter or for three quarters of the way between them, whichever level a pulse has. The board
reports the level at the times of its frames, and when the edge before came: how far the wheel has
turned since then, relative to the way between two edges, follows from the time if it turns evenly.
Lengths are pitches.
"""

from __future__ import annotations

from math import exp, floor, log
from typing import Final, NamedTuple

from diffbotctl.estimation.edge_counts import OPEN_SHARE
from diffbotctl.estimation.wheel_kalman import WheelKalman

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


ROUNDING = 1e-9  # pitches
PART_MIN = 0.25  # pitches; the bounds only touch a shorter part of an interval
# A level is used when the predicted probability outside of its intervals exceeds this: at rest,
# where repeated frames carry no new information, and in motion. No edge time carries it.
OUTSIDE_MIN_AT_REST, OUTSIDE_MIN = 0.08, 0.01
# The wheel is in the interval that is this likely, given the level. An interval that is less likely
# than the minimum contradicts the prediction, unless the wheel stands so near to an edge (standard
# deviations) that the level may be either.
INTERVAL_PROBABILITY, INTERVAL_PROBABILITY_MIN, AT_EDGE_SDS = 0.95, 0.01, 2.0
LOG_WRONG_LEVEL = -4.0  # natural log; of a level that is independent of the next edge (about 1:50)

COUNTED_LEVELS: Final = {"rising": 1, "falling": 0}
"""by the edge that is counted; when both are, the pin has a counted level all the time"""


class TurningLevel(NamedTuple):
    """The level of the pin since the last edge, before the wheel reversed."""

    has_counted_level: bool
    was_at_rest: bool

    def first_edge_log_prior(self, is_behind: bool) -> float:
        """Log probability that the first edge after the reversal `is_behind` the last one before.

        Beyond the open share after an edge, the pin has not the counted level, and the wheel first
        comes back past the place where that share ends; else past the one behind the edge. A wheel
        that had the counted level may have rolled on, unless it was at rest.
        """
        if is_behind == self.has_counted_level:
            return 0.0
        return LOG_WRONG_LEVEL if not self.has_counted_level or self.was_at_rest else 0.0


def intervals(
    low: float, high: float, has_counted_level: bool, open_share: float
) -> list[tuple[float, float]]:
    """The intervals of z from `low` to `high` in which the pin has the counted level, or not."""
    begin, end = _part_of_slot(has_counted_level, open_share)
    found = []
    slot = floor(low + ROUNDING)
    while slot + begin < high:
        part = max(slot + begin, low), min(slot + end, high)
        if part[1] - part[0] > PART_MIN:
            found.append(part)
        slot += 1
    return found


def place_by_level(motion: WheelKalman, has_counted_level: bool) -> None:
    """Update a wheel that has passed no edge yet, with z anywhere from 0 to 1."""
    motion.update_uniform(*intervals(0.0, 1.0, has_counted_level, _open_share(motion))[0])


def update_by_level(
    motion: WheelKalman, low: float, high: float, has_counted_level: bool, is_at_rest: bool
) -> None:
    """Update a wheel whose z is between `low` and `high` by its edges. `is_at_rest`: or turns
    round."""
    open_share = _open_share(motion)
    begin, end = _part_of_slot(has_counted_level, open_share)
    place = motion.z % 1.0
    if motion.is_surely_nearer(min(place - begin, end - place)):
        return  # as it was in nearly all frames
    parts = intervals(low, high, has_counted_level, open_share)
    likely = [motion.probability_within(*part) for part in parts]
    probability = sum(likely, 0.0)
    if probability > 1.0 - (OUTSIDE_MIN_AT_REST if is_at_rest else OUTSIDE_MIN):
        return
    if probability < INTERVAL_PROBABILITY_MIN:
        if motion.is_near(low, AT_EDGE_SDS) or motion.is_near(high, AT_EDGE_SDS):
            motion.log_likelihood += log(INTERVAL_PROBABILITY_MIN)
            return
        part = min(parts, key=lambda part: max(part[0] - motion.z, motion.z - part[1]))
    else:
        part = parts[likely.index(max(likely))]
        if max(likely) < INTERVAL_PROBABILITY * probability:
            motion.log_likelihood += log(probability)
            return
    motion.update_bounds(*part)


def _part_of_slot(has_counted_level: bool, open_share: float) -> tuple[float, float]:
    """Where in a slot the pin has the counted level, or not."""
    return (0.0, open_share) if has_counted_level else (open_share, 1.0)


def _open_share(motion: WheelKalman) -> float:
    return OPEN_SHARE + motion.priors.open_share_error
