"""How many edges a wheel has passed that counts some: as many, or some missed or additional."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor, log
from typing import NamedTuple

from diffbotctl.estimation.edge_faults import EdgeFaults
from diffbotctl.estimation.edge_places import bounds, edge_place
from diffbotctl.estimation.likelihood import robust_log_likelihood
from diffbotctl.estimation.wheel_kalman import WheelKalman

# An edge this near to its expected place (pitches) is that edge: all others are farther away, and
# less likely from the start.
EXPECTED_MAX = 0.4
MISSED_MAX = 2  # in a row; a wheel without edges for longer is held
EXTRA_MAX = 4  # in a frame
# An additional edge mostly bounces, soon after the edge: log density in the pitch, and beyond.
EXTRA_PITCHES, EXTRA_LOG_DENSITY, LATE_EXTRA_LOG_DENSITY = 0.3, 1.1, -2.0
PREDICTED_SD_MAX = 0.5  # pitches; above it an edge cannot be distinguished from its neighbours
CERTAIN_PROBABILITY = 0.3  # of the count being right, above which no fault is considered


class PassedCount(NamedTuple):
    """One candidate for the number of edges that were passed."""

    fit: float
    """log likelihood including the prior"""
    log_prior: float
    missed: int
    """edges passed but not counted; negative: counted but not passed"""
    is_timed: bool
    """whether the edge time is that of the last edge passed"""


EXPECTED_COUNT = (PassedCount(0.0, 0.0, 0, True),)


def counts_until_edge(
    motion: WheelKalman, faults: EdgeFaults, slot: int, direction: int, steps: int, bounces: bool
) -> Sequence[PassedCount]:
    """Candidates for the edges passed since that of `slot`, in `direction`, until the time of the
    last of the `steps` edges counted, to which `motion` is predicted. `bounces`: whether additional
    ones are possible."""
    beyond = direction * (motion.z - edge_place(slot + direction * steps, direction))
    variance = motion.edge_variance(direction > 0)
    if (
        -EXPECTED_MAX < beyond < EXPECTED_MAX
        or variance > PREDICTED_SD_MAX**2
        or not motion.finds_faults
    ):
        return EXPECTED_COUNT
    counts, cost = [], motion.change_cost(direction * beyond)
    extra_max = min(steps, EXTRA_MAX) if bounces else 0
    for missed in sorted({0, floor(beyond), ceil(beyond)}):
        if not -extra_max <= missed <= MISSED_MAX:
            continue
        log_prior = faults.log_prior(missed)
        fit = robust_log_likelihood(beyond - missed, variance, cost)
        # The time may be that of an additional edge, which comes at any place in the pitch.
        is_soon = beyond - floor(beyond) < EXTRA_PITCHES
        early = EXTRA_LOG_DENSITY if is_soon else LATE_EXTRA_LOG_DENSITY
        is_timed = steps + missed > 0 and (missed >= 0 or fit > early)
        fit = fit if is_timed else early
        counts.append(PassedCount(fit + log_prior, log_prior, missed, is_timed))
    return counts or EXPECTED_COUNT


def counts_until_frame(
    motion: WheelKalman, faults: EdgeFaults, slot: int, direction: int, steps: int, bounces: bool
) -> Sequence[PassedCount]:
    """The same until the time of the frame, where the board reports no edge times."""
    counts: list[PassedCount] = []
    if not motion.finds_faults:
        return [PassedCount(0.0, 0.0, 0, False)]
    others = (-1, 1) if bounces else (1,)
    for missed in (0, *others):
        log_prior = faults.log_prior(missed)
        place = edge_place(slot + direction * (steps + missed), direction)
        fit = motion.bounds_log_likelihood(*bounds(place, direction, False))
        counts.append(PassedCount(fit + log_prior, log_prior, missed, False))
        if missed == 0 and fit > log(CERTAIN_PROBABILITY):
            break
    return counts
