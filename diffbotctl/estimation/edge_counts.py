"""How many edges a wheel has passed that counts some: as many, or some missed or additional.

z is the position of the disc under the light barrier in pitches. Turning forward, the board counts
an edge at each whole z; turning backward, at each whole z plus the open share of the pitch.

A light barrier misses an edge when its light is weak or an interrupt is late; it counts one twice
when the edge bounces for longer than the glitch filter lasts, or when the motors disturb the wire.
Each hypothesis counts its own faults, so a bad encoder's rate is learnt by the hypotheses that
explain its counts (the predictive probability of a beta-binomial model).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor, log
from typing import NamedTuple

from diffbotctl.estimation.wheel_kalman import WheelKalman, robust_log_likelihood

OPEN_SHARE = 0.5  # of the pitch; mean of all discs


def edge_place(slot: int, direction: int) -> float:
    """Nominal z of the edge of `slot` that is counted in `direction` (1 or -1)."""
    return slot + (OPEN_SHARE if direction < 0 else 0.0)


def bounds(place: float, direction: int, is_reversed: bool) -> tuple[float, float]:
    """Range of z after an edge at `place` that was passed in `direction`.

    After a reversal the next edge may be either edge of the slot, which narrows the range.
    """
    if direction > 0:
        return place - (1.0 - OPEN_SHARE if is_reversed else 0.0), place + 1.0
    return place - 1.0, place + (1.0 - OPEN_SHARE if is_reversed else 0.0)


# Before any edge, the rate of faults is this one, and counts as much as so many edges. An encoder
# that works has fewer; one that does not is recognised after two or three faults.
PRIOR_RATE = 0.001
PRIOR_EDGES = 50.0
RATE_MAX = 0.1  # above it counts are no measurement any more
# A fault is followed by another one with this probability: an edge that bounces does so more than
# once.
BURST_PROBABILITY = 0.3
LOG_BURST = log(BURST_PROBABILITY)
# Pitches; of an assumed fault: each on its own, and all alike.
FAULT_SD, ALIKE_SD = 1.0, 0.5
# Faults per edge at which the motion was too uncertain to notice one because the counts had not
# been as predicted: most often faults are the reason. Found with simulated robots.
SUSPECT_RATE = 0.08
SHARE_REPORTED = 0.004  # faults per edge that are worth a warning: four times the prior rate


class EdgeFaults(NamedTuple):
    """The faults of one encoder that a hypothesis assumes."""

    edges: int = 0
    missed: int = 0
    extra: int = 0
    unresolved: int = 0
    """edges at which the motion was too uncertain to notice that another one was missing"""
    suspect: int = 0  # those of them before which the counts were not as predicted

    def log_prior(self, missed: int) -> float:
        """Log probability that `missed` edges were not counted; negative: counted in excess."""
        if missed == 0:
            return 0.0
        faults = self.missed if missed > 0 else self.extra
        rate = (PRIOR_RATE * PRIOR_EDGES + faults) / (PRIOR_EDGES + self.edges)
        return log(min(rate, RATE_MAX)) + (abs(missed) - 1) * LOG_BURST

    def added(self, edges: int, missed: int) -> EdgeFaults:
        """After `edges` counts of which `missed` were missing, or, if negative, in excess."""
        return EdgeFaults(
            self.edges + edges,
            self.missed + missed if missed > 0 else self.missed,
            self.extra - missed if missed < 0 else self.extra,
            self.unresolved,
            self.suspect,
        )

    def added_unresolved(self, edges: int, is_suspect: bool) -> EdgeFaults:
        """After `edges` at which the motion was too uncertain to notice a fault."""
        return EdgeFaults(
            self.edges,
            self.missed,
            self.extra,
            self.unresolved + edges,
            self.suspect + edges if is_suspect else self.suspect,
        )

    @property
    def variance(self) -> float:
        """Variance of the travel (pitches2).

        Faults that could not be noticed are one pitch each, and as probable as the faults seen make
        them; where the counts are suspect they are all of one kind, missing or additional edges.
        Those assumed may be errors of the motor model instead, one of them or all alike.
        """
        number = self.missed + self.extra
        assumed = FAULT_SD * FAULT_SD * number + (ALIKE_SD * number) ** 2
        if not self.unresolved:
            return assumed
        faults = PRIOR_RATE * PRIOR_EDGES + number
        unseen = self.unresolved * min(faults / (PRIOR_EDGES + self.edges), RATE_MAX)
        alike = self.suspect * SUSPECT_RATE
        return assumed + unseen + alike + alike * alike

    @property
    def number(self) -> int:
        """Edges missed or counted in excess."""
        return self.missed + self.extra

    @property
    def text(self) -> str:
        """What is wrong with the encoder, or an empty text."""
        if self.missed + self.extra < 2:
            return ""
        if max(self.missed, self.extra) < SHARE_REPORTED * self.edges:
            return ""
        if self.missed >= self.extra:
            return f"edges are missing: about {self.missed} of {self.edges + self.missed}"
        return f"edges are counted twice: about {self.extra} of {self.edges}"


NO_FAULTS = EdgeFaults()

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

    fit: float  # log likelihood including the prior
    log_prior: float
    missed: int  # edges passed but not counted; negative: counted but not passed
    is_timed: bool  # whether the edge time is that of the last edge passed


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
