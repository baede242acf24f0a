"""Share of missed or additional edges of a fine encoder whose edges have times.

A gear whose teeth cog turns the wheel as unevenly as a fault in every tenth edge would, but it
swings evenly, within limits, and never by a whole edge at once: a fault changes the counts of one
span by one. So the fourth difference of five spans (see `count_faults.py`) shows one of its five
weights, where one of them has a fault, and the values of a sine, where the motion swings. Each
hypothesis has both, an unevenness and a share.
"""

from __future__ import annotations

from collections import Counter
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
    (0.025, 0.06),
    (0.05, 0.05),
    (0.1, 0.04),
    (0.2, 0.02),
)
# A sine with the standard deviation 1 takes the middles of its four quarters by value for equal
# times: the sines of 22.5 and 67.5 degrees times the root of 2, of both signs. Around each of them
# the values scatter by about a quarter.
SINE_VALUES, SINE_SPREAD = (-1.307, -0.541, 0.541, 1.307), 0.0625
SINE_MIN = 4.0  # variance of the motion over that by the slots; below it a sine is not told


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
        self.spans, self.slot_variance = len(weights), slot_variance
        self.squares = sum(weight * weight for weight in weights)
        # What one fault adds to the difference, with probabilities: of either sign.
        signed = Counter(weight * sign for weight in weights for sign in (-1.0, 1.0))
        self.single = [(value, count / (2.0 * len(weights))) for value, count in signed.items()]
        self.shares = ((0.0, 1.0 - faulty), *((share, faulty * part) for share, part in shares))
        self.logs = [log(likely * part) for _, likely in UNEVENNESS for _, part in self.shares]
        self.mean_square = faulty * sum(share * share * part for share, part in shares)
        """of the share, over its probabilities"""
        self.probability = faulty
        """that there are faults"""

    def add(self, square: float, edges: float, rough: float, samples: float) -> None:
        """Take a squared difference of spans with `edges` on average, worth `samples` independent
        ones; `rough`: its density where the motion was not smooth, times its probability."""
        size = sqrt(square)
        parts = [self._faults_in(edges * share) for share, _ in self.shares]
        index = 0
        for uneven, _ in UNEVENNESS:
            motion = self.squares * (uneven * edges) ** 2
            noise = self.slot_variance + motion
            none = self._density(size, motion)
            one = sum(part * self._density(size - value, motion) for value, part in self.single)
            for no_fault, one_fault, more, variance in parts:
                likely = no_fault * none + one_fault * one
                if more:
                    likely += more * normal_density(square, noise + variance)
                self.logs[index] += log(rough + likely) * samples
                index += 1
        self._sum()

    def _density(self, value: float, motion: float) -> float:
        """Of the cut of the slots and a `motion` with that variance."""
        if motion < SINE_MIN * self.slot_variance:
            return normal_density(value * value, self.slot_variance + motion)
        sd, variance = sqrt(motion), self.slot_variance + SINE_SPREAD * motion
        densities = (normal_density((value - each * sd) ** 2, variance) for each in SINE_VALUES)
        return sum(densities) / len(SINE_VALUES)

    def _faults_in(self, faults: float) -> tuple[float, float, float, float]:
        """Probabilities that five spans with `faults` in each on average have none, one and more;
        the variance that those add."""
        if not faults:
            return 1.0, 0.0, 0.0, 0.0
        mean = self.spans * faults  # of a Poisson distribution
        none = exp(-mean)
        one = mean * none
        more = 1.0 - none - one
        if more < 1e-9:
            return none, one, 0.0, 0.0
        return none, one, more, self.squares / self.spans * (mean - one) / more

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
