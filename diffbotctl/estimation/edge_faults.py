"""Edges that the board missed, and counts without an edge: their rates and prior probabilities.

A light barrier misses an edge when its light is weak or an interrupt is late; it counts one twice
when the edge bounces for longer than the glitch filter lasts, or when the motors disturb the wire.
Each hypothesis counts its own faults, so a bad encoder's rate is learnt by the hypotheses that
explain its counts (the predictive probability of a beta-binomial model).
"""

from __future__ import annotations

from math import log
from typing import NamedTuple

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
    suspect: int = 0
    """those of them before which the counts were not as predicted"""

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
