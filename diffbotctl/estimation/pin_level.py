"""Bounds on the angle of a wheel by the level of its encoder's pin.

An edge is counted where the pin goes to the counted level: forward at each whole z, backward at
each whole z plus the open share. So the pin has the counted level from each whole z to there.
Lengths are pitches.
"""

from __future__ import annotations

from math import floor, log
from typing import Final, NamedTuple

from diffbotctl.estimation.edge_places import OPEN_SHARE
from diffbotctl.estimation.wheel_kalman import WheelKalman

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
