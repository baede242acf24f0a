"""Encoders that lose every second edge, or count each one twice, by what their motors explain.

Such a wheel counts half, or twice, of the edges that the duty of its motor explains. What a duty
explains is uncertain. The dead band and the shape of the curve from duty to speed are the same for
both motors, nearly: one unknown for both takes them up. So is the load of the robot, which motors
calibrated with raised wheels do not have, and the battery. One of them may have a load of its own.

It follows a change within a second or two. The gains that the filters of coarse encoders find
(`lost_edges`) follow within tens of seconds, but do not depend on that curve.
"""

from __future__ import annotations

from collections.abc import Sequence

from diffbotctl.estimation.count_mismatch import CountMismatch, is_linear
from diffbotctl.estimation.edge_ratio_steps import EdgeRatioSteps
from diffbotctl.estimation.edge_residual import (
    GAIN_SD,
    LOAD_PROBABILITY,
    MEASURED_MOTORS,
    MOTORS,
    EdgeLogRatio,
    MotorHypothesis,
    density,
    fault_likelihoods,
    loaded_likelihood,
    of_classes,
    residual,
)
from diffbotctl.estimation.explained_edges import ExplainedEdges
from diffbotctl.estimation.lost_edges import (
    FRAMES_MIN,
    OTHER_PROBABILITY,
    SHIFT_PRIORS,
    SHIFTS,
    FaultProbabilities,
    LostEdges,
    normalized,
)
from diffbotctl.estimation.wheel_side import SideConfig
from diffbotctl.messages import Encoders

# Below it such an encoder is not considered: little more than before anything was counted. A sum of
# edges says more than the gain of a filter.
EXPLAINED_PROBABILITY_MIN = 0.04
COMPARE_S = 0.2  # of driving
RATIO_LOG_MIN = 0.3  # of the two ratios; less is no reason for a doubt about one of them
LEVEL_LOG_MIN = 0.3  # by which both are low; less is no reason for a doubt about both
# Edges that must be explained: two or three frames of a fine encoder.
EXPLAINED_MIN = 20.0
EVEN_MIN = 5.0  # the same for sums that are even: gains of few edges are known even less
# None of these, with OTHER_PROBABILITY: mean and standard deviation of what both logarithms share,
# and standard deviations of what each has of its own, and each class of duties.
OTHER_MEAN, OTHER_LEVEL_SD, OTHER_SD, OTHER_CLASS_SD = -0.4, 0.8, 0.4, 0.2
HEALTHY = 1.0 - LOAD_PROBABILITY - OTHER_PROBABILITY - sum(SHIFT_PRIORS)


class ExplainedLostEdges(LostEdges):
    """Whether encoders count half or twice of the edges that the duties explain."""

    def __init__(
        self, left: SideConfig, right: SideConfig, may_have_wrong_slots: bool = True
    ) -> None:
        super().__init__(may_have_wrong_slots)
        self.left, self.right = ExplainedEdges(left), ExplainedEdges(right)
        is_measured = left.motor.decay is not None and right.motor.decay is not None
        self.motors = MEASURED_MOTORS if is_measured else MOTORS
        self.steps = EdgeRatioSteps(self.motors)
        motors = left.motor, right.motor
        self.mismatch = CountMismatch(all(map(is_linear, motors)))
        self.compared = 0.0  # s of driving of both wheels, at the last comparison
        self.are_even = False
        """whether both wheels count as many edges as is explained, or both wrong alike"""

    def restart(self, encoders: Encoders) -> None:
        """Go on with a frame after a gap, or with the first one."""
        self.left.restart(encoders.time, encoders.left)
        self.right.restart(encoders.time, encoders.right)
        self.steps.restart()

    def update(
        self,
        frame: Encoders,
        since: int,
        left_duty: float | None = None,
        right_duty: float | None = None,
    ) -> None:
        """Take a frame whose commands are in effect since `since` (ns); duties as the
        `mirrored_duty` of each wheel."""
        is_duty, time = frame.command_kind == "duty", frame.time
        left, right = [(since, frame.left_command)], [(since, frame.right_command)]
        skipped = frame.skipped_command_time
        if skipped is not None:
            left.insert(0, (skipped, frame.skipped_left_command))
            right.insert(0, (skipped, frame.skipped_right_command))
        self.left.update(time, frame.left, frame.left_edge, left, is_duty, left_duty)
        self.right.update(time, frame.right, frame.right_edge, right, is_duty, right_duty)
        driven = max(self.left.driven, self.right.driven)
        if driven >= self.compared + COMPARE_S:
            self.compared = driven
            self._compare_edges()
            self._compare_levels()

    def _compare_levels(self) -> None:
        """Suspect the slots where neither motor can have made its edges."""
        left, right = self.left.state.whole, self.right.state.whole
        if not (self.may_have_wrong_slots and self.possible.of_both):
            return
        if min(left.explained, right.explained) < EVEN_MIN:
            return
        mismatch = self.mismatch.compare(left, right)
        if mismatch.probability:
            self.present = self.lasting = mismatch

    def _compare_edges(self) -> None:
        left, right = self.left.state, self.right.state
        explained = min(left.whole.explained, right.whole.explained)
        self.are_even = False
        if explained < EVEN_MIN:
            return
        whole = EdgeLogRatio.of(left.whole), EdgeLogRatio.of(right.whole)
        self.are_even = abs(whole[0].value - whole[1].value) < RATIO_LOG_MIN
        if explained < EXPLAINED_MIN:
            return
        is_usual = self.are_even and whole[0].value + whole[1].value > -2.0 * LEVEL_LOG_MIN
        if is_usual and not self.shows_missing_pulses:
            faults = FaultProbabilities()
        else:
            ratios = of_classes(left.ratios), of_classes(right.ratios)
            faults = ratio_probabilities(*ratios, self.are_even, self.motors)
        stepped = self.steps.compare(left, right)
        faults = max(
            self._given_pulses(faults),
            stepped.given_pulses(*self.pulse_ratios, may_have_wrong_slots=False),
            key=sum,
        )
        self._take(faults, EXPLAINED_PROBABILITY_MIN, FRAMES_MIN // 2)


def ratio_probabilities(
    left: Sequence[EdgeLogRatio],
    right: Sequence[EdgeLogRatio],
    is_even: bool,
    motors: Sequence[MotorHypothesis] = MOTORS,
) -> FaultProbabilities:
    """Probabilities of the faults by the edges counted over those explained of both wheels, in one
    or several classes of duties. `is_even`: of one wheel alone there is no doubt."""
    healthy = OTHER_PROBABILITY * density(
        residual(left, 0.0, 0.0, OTHER_CLASS_SD).moved(-OTHER_MEAN, OTHER_SD * OTHER_SD),
        residual(right, 0.0, 0.0, OTHER_CLASS_SD).moved(-OTHER_MEAN, OTHER_SD * OTHER_SD),
        OTHER_LEVEL_SD,
    )
    faults = [0.0] * len(SHIFTS)
    gain = GAIN_SD * GAIN_SD
    for curve, load, weight in motors:
        a, b = (residual(wheel, curve, load).moved(0.0, gain) for wheel in (left, right))
        healthy += weight * (HEALTHY * density(a, b) + loaded_likelihood(a, b))
        for index, likelihood in enumerate(fault_likelihoods(a, b, is_even)):
            faults[index] += weight * likelihood
    return normalized(faults, healthy)
