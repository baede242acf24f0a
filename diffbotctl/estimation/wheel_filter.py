"""Multi-hypothesis Kalman filter of one wheel's angle, finer than the slots of its encoder."""

from __future__ import annotations

from math import exp, inf

from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis, prune, update_all
from diffbotctl.estimation.predicted_wheel import MotorKind
from diffbotctl.estimation.slot_errors import LEARNABLE_SLOTS_MAX
from diffbotctl.estimation.wheel_frame import WheelFrame
from diffbotctl.estimation.wheel_kalman import WheelKalman
from diffbotctl.estimation.wheel_side import Priors

HYPOTHESES_MAX = 8
# The kinds of a motor by the decay of its current, with the natural log of their ratio to usual
# ones: where the decay is not known as many free-wheel, and one in ten is unusual.
UNUSUAL_LOG_PRIOR = -2.3
LINEAR_KINDS = (MotorKind.LINEAR, 0.0), (MotorKind.UNUSUAL_LINEAR, UNUSUAL_LOG_PRIOR)
FREE_WHEELING_KINDS = (
    (MotorKind.FREE_WHEELING, 0.0),
    (MotorKind.UNUSUAL_FREE_WHEELING, UNUSUAL_LOG_PRIOR),
)
KINDS = {
    None: (
        LINEAR_KINDS[0],
        FREE_WHEELING_KINDS[0],
        LINEAR_KINDS[1],
        FREE_WHEELING_KINDS[1],
    ),
    "slow": LINEAR_KINDS,
    "fast": FREE_WHEELING_KINDS,
}
# Natural log; a motor is surely unusual if a usual one is less likely by more (about 1:20).
UNUSUAL_LOG_RATIO = 3.0
LOG_RATIO_MAX = (
    7.0  # natural log; hypotheses less likely than the best by more are dropped (about 1:1000)
)


class WheelFilter:
    """Angle and speed of one wheel. `hypotheses` are the likely ones, best first."""

    def __init__(self, priors: Priors, time: int, count: int, slots: int) -> None:
        """`slots` of the disc; their errors are estimated if the board reports edge times."""
        kinds = KINDS[priors.decay]
        is_fine = slots > LEARNABLE_SLOTS_MAX
        if is_fine:  # its counts alone are accurate, and a motor model cannot tell its slots apart
            priors = priors._replace(change_cost=inf)
            kinds = kinds[:1]
        self.hypotheses = []
        for kind, log_prior in kinds:
            motion = WheelKalman(priors, slots, kind)
            motion.log_likelihood = log_prior
            self.hypotheses.append(EdgeHypothesis(motion, time, count))

    @property
    def motion(self) -> WheelKalman:
        """Estimate of the best hypothesis."""
        return self.hypotheses[0].motion

    @property
    def variance(self) -> float:
        """Variance of the travel (pitches2) if the best hypothesis is right, including faults of
        the encoder that nothing shows."""
        best = self.hypotheses[0]
        return best.motion.variance + best.faults.variance

    @property
    def disagreement(self) -> float:
        """Variance of the travel (pitches2) between the hypotheses: their differences from the best
        one, weighted by their probabilities."""
        if len(self.hypotheses) == 1:
            return 0.0
        best = self.motion
        top = max(hypothesis.motion.log_likelihood for hypothesis in self.hypotheses)
        travel, variance = best.travel, best.variance
        total = spread = 0.0
        for hypothesis in self.hypotheses:
            motion = hypothesis.motion
            weight = exp(motion.log_likelihood - top)
            total += weight
            difference = motion.travel - travel
            spread += weight * (difference**2 + max(motion.variance - variance, 0.0))
        return spread / total

    @property
    def is_unusual(self) -> bool:
        """Whether the motor is surely not of the usual kind: no hypothesis that it is remains."""
        best = self.hypotheses[0].motion
        if best.is_typical:
            return False
        limit = best.log_likelihood - UNUSUAL_LOG_RATIO
        return not any(
            hypothesis.motion.is_typical and hypothesis.motion.log_likelihood > limit
            for hypothesis in self.hypotheses
        )

    def update(self, frame: WheelFrame) -> None:
        self.hypotheses = update_all(self.hypotheses, frame)
        if len(self.hypotheses) > 1:
            self.hypotheses = prune(
                self.hypotheses, HYPOTHESES_MAX, LOG_RATIO_MAX, lambda hypothesis: hypothesis.key
            )
