"""Share of missed or additional edges of a fine encoder whose edges have times.

A gear whose teeth cog turns the wheel as unevenly as a fault in every tenth edge would, but it
swings evenly, within limits, and never by a whole edge at once: a fault changes the counts of one
span by one. So the fourth difference of five spans (see `count_faults.py`) shows one of its five
weights, where one of them has a fault, and the values of a sine, where the motion swings. Each
hypothesis has both, an unevenness and a share.
"""

from __future__ import annotations

from collections import Counter
from math import exp, log, sqrt

from diffbotctl.estimation.count_spans import SQUARES, WEIGHTS, Deviation
from diffbotctl.estimation.fault_share_priors import FAULTY, SHARE_UNKNOWN, SHARES, rough_density
from diffbotctl.estimation.likelihood import normal_density
from diffbotctl.estimation.rounding_noise import SLOT_VARIANCE

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
FAULTY_MIN = 0.9  # probability of faults for them to be told
SINE_MIN = 4.0  # variance of the motion over that by the slots; below it a sine is not told


class TimedFaultShares:
    """Probabilities of all shares and unevennesses."""

    def __init__(self) -> None:
        # What one fault adds to the difference, with probabilities: of either sign.
        signed = Counter(weight * sign for weight in WEIGHTS for sign in (-1.0, 1.0))
        self.single = [(value, count / (2.0 * len(WEIGHTS))) for value, count in signed.items()]
        self.shares = ((0.0, 1.0 - FAULTY), *((share, FAULTY * part) for share, part in SHARES))
        self.logs = [log(likely * part) for _, likely in UNEVENNESS for _, part in self.shares]
        self.mean_square = SHARE_UNKNOWN * SHARE_UNKNOWN
        """of the share, over its probabilities"""
        self.probability = FAULTY
        """that there are faults"""

    @property
    def shows_faults(self) -> bool:
        """Whether there are faults, probably enough to tell them."""
        return self.probability > FAULTY_MIN

    def noise(self, edges: float, slope: float) -> float:
        """Variance without faults of five spans."""
        return SLOT_VARIANCE

    def add(self, deviation: Deviation, deviations_per_sample: float) -> None:
        """Take a deviation; so many are worth one independent one."""
        square, edges, _ = deviation
        rough, samples = rough_density(square, edges, SLOT_VARIANCE), 1.0 / deviations_per_sample
        size = sqrt(square)
        parts = [self._faults_in(edges * share) for share, _ in self.shares]
        index = 0
        for uneven, _ in UNEVENNESS:
            motion = SQUARES * (uneven * edges) ** 2
            noise = SLOT_VARIANCE + motion
            none = self._density(size, motion)
            one = sum(
                (part * self._density(size - value, motion) for value, part in self.single), 0.0
            )
            for no_fault, one_fault, more, variance in parts:
                likely = no_fault * none + one_fault * one
                if more:
                    likely += more * normal_density(square, noise + variance)
                self.logs[index] += log(rough + likely) * samples
                index += 1
        self._sum()

    def _density(self, value: float, motion: float) -> float:
        """Of the cut of the slots and a `motion` with that variance."""
        if motion < SINE_MIN * SLOT_VARIANCE:
            return normal_density(value * value, SLOT_VARIANCE + motion)
        sd, variance = sqrt(motion), SLOT_VARIANCE + SINE_SPREAD * motion
        densities = (normal_density((value - each * sd) ** 2, variance) for each in SINE_VALUES)
        return sum(densities, 0.0) / len(SINE_VALUES)

    def _faults_in(self, faults: float) -> tuple[float, float, float, float]:
        """Probabilities that five spans with `faults` in each on average have none, one and more;
        the variance that those add."""
        if not faults:
            return 1.0, 0.0, 0.0, 0.0
        mean = len(WEIGHTS) * faults  # of a Poisson distribution
        none = exp(-mean)
        one = mean * none
        more = 1.0 - none - one
        if more < 1e-9:
            return none, one, 0.0, 0.0
        return none, one, more, SQUARES / len(WEIGHTS) * (mean - one) / more

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
