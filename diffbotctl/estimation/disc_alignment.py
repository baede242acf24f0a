"""Finds which slot of a measured disc is under the light barrier after power-on.

The slot errors of the disc form a known pattern, but its rotation is unknown at power-on. Every
possible rotation is a hypothesis; the first edges show which is right. About six edges are enough:
the errors of neighbouring slots differ by about 4 % of a pitch, and the filter predicts an edge of
a rolling wheel to a few thousandths of a pitch.
"""

from __future__ import annotations

from math import exp, log

from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis, prune, update_all
from diffbotctl.estimation.slot_errors import EdgeErrors, KnownSlotErrors
from diffbotctl.estimation.wheel_frame import WheelFrame

LOG_RATIO_MAX = (
    9.0  # natural log; hypotheses less likely than the best by more are dropped (about 1:8000)
)
HYPOTHESES_MAX = 40  # two for each turn of a disc with 20 slots
PROBABILITY_MIN = 0.999  # the most likely rotation is accepted from this probability on
EDGES_MAX = 80  # four turns of the wheel; a disc not recognised by then is not the measured one
EDGES_MIN = 10  # fewer edges fit one of twenty rotations by chance
OTHER_DISC_PRIOR = 0.05  # prior probability that the disc is not the measured one


class DiscAlignment:
    """One set of hypotheses per rotation of the pattern, updated beside those that assume none."""

    def __init__(self, known_edges: EdgeErrors, hypotheses: list[EdgeHypothesis]) -> None:
        """Copy the `hypotheses` before the first edge, once per rotation."""
        self.count = hypotheses[0].count
        self.edges = 0
        self.hypotheses = []
        for hypothesis in hypotheses:
            for disc in known_edges.alignments():
                branch = hypothesis.copy()
                branch.motion.disc = disc
                branch.motion.log_likelihood += log(
                    (1.0 - OTHER_DISC_PRIOR) / disc.slots / OTHER_DISC_PRIOR
                )
                self.hypotheses.append(branch)

    def update(self, frame: WheelFrame) -> None:
        """Update all hypotheses with one frame and drop the unlikely ones."""
        self.edges += abs(frame.edge_count - self.count)
        self.count = frame.edge_count
        self.hypotheses = prune(
            update_all(self.hypotheses, frame),
            HYPOTHESES_MAX,
            LOG_RATIO_MAX,
            lambda hypothesis: (hypothesis.key, _slot_at_barrier(hypothesis)),
        )

    def aligned(self, unaligned: EdgeHypothesis) -> EdgeHypothesis | None:
        """The most likely hypothesis once its rotation is certain, else None.

        `unaligned` is the best hypothesis that assumes no pattern.
        """
        if self.edges < EDGES_MIN:
            return None
        best = self.hypotheses[0]
        best_log_likelihood = best.motion.log_likelihood
        if best_log_likelihood < unaligned.motion.log_likelihood:
            return None
        weights: dict[int, float] = {}
        for hypothesis in self.hypotheses:
            # Grouped by the slot under the barrier: hypotheses may count the edges differently.
            slot = _slot_at_barrier(hypothesis)
            weight = exp(hypothesis.motion.log_likelihood - best_log_likelihood)
            weights[slot] = weights.get(slot, 0.0) + weight
        other_disc = exp(unaligned.motion.log_likelihood - best_log_likelihood)
        probability = weights[_slot_at_barrier(best)] / (sum(weights.values(), 0.0) + other_disc)
        return best if probability >= PROBABILITY_MIN else None

    def has_failed(self, unaligned: EdgeHypothesis) -> bool:
        """True when the disc is probably not the measured one."""
        if self.edges > EDGES_MAX:
            return True
        best_log_likelihood = self.hypotheses[0].motion.log_likelihood
        return best_log_likelihood < unaligned.motion.log_likelihood - LOG_RATIO_MAX


def _slot_at_barrier(hypothesis: EdgeHypothesis) -> int:
    """Index in the pattern of the slot that is under the light barrier."""
    disc = hypothesis.motion.disc
    assert isinstance(disc, KnownSlotErrors)
    return (hypothesis.edge_slot + disc.first_slot) % disc.slots
