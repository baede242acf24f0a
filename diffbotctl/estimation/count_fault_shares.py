"""Share of missed or additional edges of an encoder whose edges have no times, or come slowly."""

from __future__ import annotations

from math import exp, log

from diffbotctl.estimation.count_spans import SQUARES, WEIGHTS, Deviation
from diffbotctl.estimation.fault_share_priors import (
    FAULTY,
    ROUGH_SHARE,
    SHARE_UNKNOWN,
    SHARES,
    rough_density,
)
from diffbotctl.estimation.likelihood import normal_density
from diffbotctl.estimation.rounding_noise import SLOT_VARIANCE, count_noise

# Standard deviation of the mean speed in a span, relative to the speed, by which a motor turns
# unevenly: gears, commutator and the loop of the board. With probabilities.
UNEVENNESS = ((0.0, 0.6), (0.003, 0.25), (0.006, 0.15))
# Unevenness, signed share (of additional edges; of missing ones if negative) and log probability.
HYPOTHESES = (
    *((uneven, 0.0, log(likely * (1.0 - FAULTY))) for uneven, likely in UNEVENNESS),
    *(
        (0.0, sign * share, log(0.5 * FAULTY * part))
        for share, part in SHARES
        for sign in (-1.0, 1.0)
    ),
)


class CountFaultShares:
    """Probabilities of all shares, and of all unevennesses without faults.

    The deviations are normal with the variance of each; few faults are in few of them only, in any
    of five spans, and then each is a whole edge.
    """

    shows_faults = True
    """whether the hypotheses alone show them: what is uneven beyond rounding does here"""

    def __init__(self, has_edge_times: bool) -> None:
        self.has_edge_times = has_edge_times
        self.logs = [prior for _, _, prior in HYPOTHESES]
        self.mean_square = SHARE_UNKNOWN * SHARE_UNKNOWN
        """of the share, over its probabilities"""

    def noise(self, edges: float, slope: float) -> float:
        """Variance without faults of five spans: `edges` on average, `slope` more in each."""
        return SLOT_VARIANCE if self.has_edge_times else count_noise(edges, slope)

    def add(self, deviation: Deviation, deviations_per_sample: float) -> None:
        """Take a deviation; so many are worth one independent one."""
        square, edges, slope = deviation
        other = rough_density(square, edges, self.noise(edges, slope))
        for index, (uneven, share, _) in enumerate(HYPOTHESES):
            noise = self.noise(edges * (1.0 - share), slope) + SQUARES * (uneven * edges) ** 2
            likely = normal_density(square, noise)
            if share:
                faults = edges * abs(share)
                affected = 1.0 - exp(-len(WEIGHTS) * faults)
                with_faults = normal_density(square, noise + SQUARES * faults / affected)
                likely += affected * (with_faults - likely)
            self.logs[index] += log(other + (1.0 - ROUGH_SHARE) * likely) / deviations_per_sample
        best = max(self.logs)
        total = mean_square = 0.0
        for (_, share, _), value in zip(HYPOTHESES, self.logs, strict=True):
            weight = exp(value - best)
            total += weight
            mean_square += weight * share * share
        self.mean_square = mean_square / total
