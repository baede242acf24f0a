"""How a measured disc stands under its light barrier, found from the first edges after power-on.

Each turn of the pattern is a hypothesis of its own until the edges have told them apart. That takes
half a dozen: two neighbouring slots are about 4 % of a pitch off each other, and a rolling wheel is
predicted to a few thousandths.
"""

from __future__ import annotations

from math import exp, log

from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis, WheelFrame, prune, update_all
from diffbotctl.estimation.slot_errors import EdgeErrors, KnownSlotErrors

LOG_RATIO_MAX = 9.0  # a hypothesis so far below the best (about 1 : 8000) is dropped
HYPOTHESES_MAX = 40  # two for each turn of a disc with 20 slots
PROBABILITY_MIN = 0.99  # from which on the likeliest turn is believed
EDGES_MAX = 80  # four turns of the wheel; after that the disc is another one
EDGES_MIN = 8  # fewer are not believed: one of twenty turns of any pattern fits a few by chance
OTHER_DISC_PRIOR = 0.05  # probability that the disc is not the one that was measured


class DiscAlignment:
    """Follows a wheel once for each turn of its pattern, beside those that assume none."""

    __slots__ = ("count", "edges", "hypotheses")

    def __init__(self, known_edges: EdgeErrors, hypotheses: list[EdgeHypothesis]) -> None:
        """Begin from the hypotheses before the first edge."""
        self.count = hypotheses[0].count
        self.edges = 0
        self.hypotheses = []
        for hypothesis in hypotheses:
            for disc in known_edges.alignments():
                twin = hypothesis.copy()
                twin.motion.disc = disc
                twin.motion.log_likelihood += log(
                    (1.0 - OTHER_DISC_PRIOR) / disc.slots / OTHER_DISC_PRIOR
                )
                self.hypotheses.append(twin)

    def update(self, frame: WheelFrame) -> None:
        """Take one frame."""
        self.edges += abs(frame.edge_count - self.count)
        self.count = frame.edge_count
        self.hypotheses = prune(
            update_all(self.hypotheses, frame),
            HYPOTHESES_MAX,
            LOG_RATIO_MAX,
            lambda hypothesis: (hypothesis.key, _slot_at_barrier(hypothesis)),
        )

    def aligned(self, unaligned: EdgeHypothesis) -> EdgeHypothesis | None:
        """The hypothesis with the right turn, once it is known; `unaligned` assumes no pattern."""
        if self.edges < EDGES_MIN:
            return None
        best = self.hypotheses[0]
        best_log_likelihood = best.motion.log_likelihood
        if best_log_likelihood < unaligned.motion.log_likelihood:
            return None
        weights: dict[int, float] = {}
        for hypothesis in self.hypotheses:
            # By the slot that is under the barrier now: hypotheses may number edges differently.
            slot = _slot_at_barrier(hypothesis)
            weight = exp(hypothesis.motion.log_likelihood - best_log_likelihood)
            weights[slot] = weights.get(slot, 0.0) + weight
        other_disc = exp(unaligned.motion.log_likelihood - best_log_likelihood)
        probability = weights[_slot_at_barrier(best)] / (sum(weights.values()) + other_disc)
        return best if probability >= PROBABILITY_MIN else None

    def has_failed(self, unaligned: EdgeHypothesis) -> bool:
        """True when the disc seems to be another one than was measured."""
        if self.edges > EDGES_MAX:
            return True
        best_log_likelihood = self.hypotheses[0].motion.log_likelihood
        return best_log_likelihood < unaligned.motion.log_likelihood - LOG_RATIO_MAX


def _slot_at_barrier(hypothesis: EdgeHypothesis) -> int:
    """Which slot of the pattern is under the light barrier."""
    disc = hypothesis.motion.disc
    assert isinstance(disc, KnownSlotErrors)
    return (hypothesis.edge_slot + disc.first_slot) % disc.slots
