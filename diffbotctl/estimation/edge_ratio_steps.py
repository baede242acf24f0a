"""An encoder that begins to lose every second edge, or to show all of them again.

Both wheels are compared with themselves, some seconds before: what a motor's calibration, the load
of the robot and the battery do to the edges that its duty explains, they did before too. Only the
curve from duty to speed matters still, for the loop of the board doubles the speed of a wheel whose
edges are lost, by more duty. A load that begins to act on one wheel looks alike.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import log
from typing import NamedTuple

from diffbotctl.estimation.edge_residual import (
    GAIN_SD,
    LOAD_PROBABILITY,
    MotorHypothesis,
    Residual,
    density,
    fault_likelihoods,
    loaded_likelihood,
    of_classes,
    residual,
)
from diffbotctl.estimation.explained_edges import EdgeRatio, EdgeState
from diffbotctl.estimation.lost_edges import (
    SHIFT_PRIORS,
    SHIFTS,
    FaultProbabilities,
    normalized,
)

# Comparisons that a step may lie back. Later ones see the earlier steps too.
AGES = 1, 2, 3, 4, 6, 8, 12
EXPLAINED_MIN = 8.0  # edges, before the step and after it
STEP_LOG_MIN = 0.3  # of the difference between both wheels, or of both; less is no reason to look
STEP_SD = 0.08  # of the logarithm of a ratio that has not changed
LEVEL_SD = 0.08  # of what both wheels share: the battery
# A load that begins to act on both wheels, or ceases to: its probability, and standard deviations
# of the logarithm of the ratio, of what both share and what each has of its own.
FLOOR_PROBABILITY, FLOOR_SD, FLOOR_OWN_SD = 0.1, 0.5, 0.15
HEALTHY = 1.0 - LOAD_PROBABILITY - FLOOR_PROBABILITY - sum(SHIFT_PRIORS)


class _Pair(NamedTuple):
    """States of both wheels at one comparison."""

    left: EdgeState
    right: EdgeState


class EdgeRatioSteps:
    """The comparisons of the last seconds of driving."""

    def __init__(self, motors: Sequence[MotorHypothesis]) -> None:
        self.motors = motors
        self.pairs: deque[_Pair] = deque(maxlen=AGES[-1])

    def restart(self) -> None:
        """The duties before are not known."""
        self.pairs.clear()

    def compare(self, left: EdgeState, right: EdgeState) -> FaultProbabilities:
        """Take the states after a frame; the likeliest step of the last seconds."""
        likeliest = FaultProbabilities()
        for age in AGES:
            if age > len(self.pairs):
                break
            before = self.pairs[-age]
            changes = _change_of_ratio(before.left, left), _change_of_ratio(before.right, right)
            if changes[0] is None or changes[1] is None:
                continue
            is_even = abs(changes[0] - changes[1]) < STEP_LOG_MIN
            if is_even and changes[0] + changes[1] > -2.0 * STEP_LOG_MIN:
                continue
            faults = step_probabilities(
                [before.left.ratios, before.right.ratios],
                [left.since(before.left), right.since(before.right)],
                is_even,
                self.motors,
            )
            likeliest = max(likeliest, faults, key=sum)
        self.pairs.append(_Pair(left, right))
        return likeliest


def step_probabilities(
    before: Sequence[Sequence[EdgeRatio]],
    after: Sequence[Sequence[EdgeRatio]],
    is_even: bool,
    motors: Sequence[MotorHypothesis],
) -> FaultProbabilities:
    """Probabilities of faults that began between `before` and `after`, of the left and of the right
    wheel, in classes of duties each. `is_even`: both wheels have changed alike."""
    old, new = ([of_classes(ratios) for ratios in when] for when in (before, after))
    if not all((*old, *new)):
        return FaultProbabilities()
    healthy, faults = 0.0, [0.0] * len(SHIFTS)
    floor, gain = FLOOR_OWN_SD * FLOOR_OWN_SD, GAIN_SD * GAIN_SD
    for motor in motors:
        (was_left, was_right), (is_left, is_right) = (
            [residual(ratios, motor.curve, motor.load) for ratios in when] for when in (old, new)
        )
        weight = motor.probability * density(was_left.moved(0.0, gain), was_right.moved(0.0, gain))
        a, b = _change(was_left, is_left), _change(was_right, is_right)
        healthy += weight * (
            HEALTHY * density(a, b, LEVEL_SD)
            + loaded_likelihood(a, b, LEVEL_SD)
            + FLOOR_PROBABILITY * density(a.moved(0.0, floor), b.moved(0.0, floor), FLOOR_SD)
        )
        for index, likelihood in enumerate(fault_likelihoods(a, b, is_even, LEVEL_SD)):
            faults[index] += weight * likelihood
    return normalized(faults, healthy)


def _change_of_ratio(before: EdgeState, now: EdgeState) -> float | None:
    """Logarithm of the ratio since `before` over that until then; None of too few edges."""
    then, fade = before.whole, now.fade(before)
    explained = now.whole.explained - fade * then.explained
    if min(explained, then.explained) < EXPLAINED_MIN:
        return None
    counted = now.whole.counted - fade * then.counted
    return log(max(counted, 1.0) * then.explained / (explained * max(then.counted, 1.0)))


def _change(was: Residual, now: Residual) -> Residual:
    """The difference between two residuals of one wheel, whose gain is the same."""
    return Residual(
        now.value - was.value,
        now.variance + was.variance + STEP_SD * STEP_SD,
        was.likelihood * now.likelihood,
    )
