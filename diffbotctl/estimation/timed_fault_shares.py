"""Share of missed or additional edges of a fine encoder whose edges have times.

A gear whose teeth cog turns the wheel as unevenly as a fault in every tenth edge would, but never
by a whole edge at once: a fault changes the counts of one span by one. So the fourth difference of
five spans (see `count_faults.py`) shows one of its five weights, where one of them has a fault, and
a normal distribution around zero, where the motion is uneven. Each hypothesis has both, an
unevenness and a share.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, log, sqrt

from diffbotctl.estimation.likelihood import normal_density

# Standard deviation of the mean speed in a span, relative to the speed, by which a motor turns
# unevenly, with probabilities. Simulated gears that cog by 5 % of the stall torque reach 0.1 where
# the motor has hardly more torque than its friction takes.
UNEVENNESS = (
    (0.0, 0.45),
    (0.003, 0.2),
    (0.006, 0.1),
    (0.0125, 0.08),
    (0.025, 0.07),
    (0.05, 0.06),
    (0.1, 0.04),
)


class TimedFaultShares:
    """Probabilities of all shares and unevennesses."""

    def __init__(
        self,
        weights: Sequence[float],
        faulty: float,
        shares: Sequence[tuple[float, float]],
        slot_variance: float,
    ) -> None:
        """`weights` of the spans in a difference, and its variance by the cut of the slots; that an
        encoder is `faulty`, and then the `shares` with their probabilities."""
        self.weights, self.slot_variance = weights, slot_variance
        self.squares = sum(weight * weight for weight in weights)
        self.shares = ((0.0, 1.0 - faulty), *((share, faulty * part) for share, part in shares))
        self.logs = [
            log(likely * part) for _, likely in UNEVENNESS for _, part in self.shares
        ]
        self.mean_square = faulty * sum(share * share * part for share, part in shares)
        """of the share, over its probabilities"""
        self.probability = faulty
        """that there are faults"""

    def add(self, square: float, edges: float, rough: float, samples: float) -> None:
        """Take a squared difference of spans with `edges` on average, worth `samples` independent
        ones; `rough`: its density where the motion was not smooth, times its probability."""
        size, weights = sqrt(square), self.weights
        parts = [self._faults_in(edges * share) for share, _ in self.shares]
        index = 0
        for uneven, _ in UNEVENNESS:
            noise = self.slot_variance + self.squares * (uneven * edges) ** 2
            none = normal_density(square, noise)
            one = sum(
                normal_density((size - weight) ** 2, noise)
                + normal_density((size + weight) ** 2, noise)
                for weight in weights
            ) / (2.0 * len(weights))
            for no_fault, one_fault, more, variance in parts:
                likely = no_fault * none + one_fault * one
                if more:
                    likely += more * normal_density(square, noise + variance)
                self.logs[index] += log(rough + likely) * samples
                index += 1
        self._sum()

    def _faults_in(self, faults: float) -> tuple[float, float, float, float]:
        """Probabilities that five spans with `faults` in each on average have none, one and more;
        the variance that those add."""
        spans = len(self.weights)
        if not faults:
            return 1.0, 0.0, 0.0, 0.0
        mean = spans * faults  # of a Poisson distribution
        none = exp(-mean)
        one = mean * none
        more = 1.0 - none - one
        if more < 1e-9:
            return none, one, 0.0, 0.0
        return none, one, more, self.squares / spans * (mean - one) / more

    def _sum(self) -> None:
        best = max(self.logs)
        total = faulty = mean_square = 0.0
        number = len(self.shares)
        for index, value in enumerate(self.logs):
            weight = exp(value - best)
            share = self.shares[index % number][0]
            total += weight
            if share:
                faulty += weight
                mean_square += weight * share * share
        self.probability, self.mean_square = faulty / total, mean_square / total
