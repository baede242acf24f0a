"""Encoders that lose every second edge, or count each one twice, by what their motors explain.

Such a wheel counts half, or twice, of the edges that the duty of its motor explains. What a duty
explains is uncertain. The dead band and the shape of the curve from duty to speed are the same for
both motors, nearly: one unknown for both takes them up. So is the load of the robot, which motors
calibrated with raised wheels do not have, and the battery. One of them may have a load of its own.

It follows a change within a second or two. The gains that the filters of coarse encoders find
(`lost_edges`) follow within tens of seconds, but do not depend on that curve.
"""

from __future__ import annotations

from math import exp, log, sqrt
from typing import NamedTuple

from diffbotctl.estimation.explained_edges import EdgeRatio, ExplainedEdges
from diffbotctl.estimation.lost_edges import (
    BOTH_PROBABILITY,
    HALF,
    HALF_PROBABILITY,
    LEVEL_SD,
    OTHER_PROBABILITY,
    FaultProbabilities,
    LostEdges,
    normalized,
)
from diffbotctl.estimation.wheel_side import SideConfig
from diffbotctl.messages import Encoders

# Below it such an encoder is not considered: little more than before anything was counted. A sum of
# edges says more than the gain of a filter.
EXPLAINED_PROBABILITY_MIN = 0.025
COMPARE_FRAMES = 10  # of a driven wheel
RATIO_LOG_MIN = 0.3  # of the two ratios; less is no reason for a doubt about one of them
LEVEL_LOG_MIN = 0.3  # by which both are low; less is no reason for a doubt about both
# Edges that must be explained: two or three frames of a fine encoder.
EXPLAINED_MIN = 20.0
EVEN_MIN = 5.0  # the same for sums that are even: gains of few edges are known even less
# Error of the typical curve from duty to speed, in edges that friction takes, with probabilities:
# 0 is a linear motor with its dead band. Motors that are quick to coast between two pulses take
# several times the speed of it at small duties.
CURVES = ((0.0, 0.3), (0.5, 0.15), (1.0, 0.15), (2.0, 0.15), (4.0, 0.15), (8.0, 0.1))
# Duty that moving the robot takes of both motors, which are calibrated with raised wheels, and its
# probability.
LOADS = ((0.0, 0.4), (0.07, 0.2), (0.14, 0.15), (0.21, 0.15), (0.3, 0.1))
COMMON_LOAD_SD = 0.15  # relative; what one of the wheels has to move
SHARE_MIN = 0.1  # of the edges explained, left by friction and load; less is not told apart
# Standard deviations of the logarithm of a ratio: of a calibrated motor; by its own friction,
# relative to that of both, and to the error of the curve; of its lag.
GAIN_SD, FRICTION_SD, CURVE_SD, LAG_SD = 0.08, 0.4, 0.2, 0.2
# A load on one of the wheels: its probability, and its standard deviation.
LOAD_PROBABILITY, LOAD_SD = 0.1, 0.35
# None of these, with OTHER_PROBABILITY: mean and standard deviation of what both logarithms share,
# and standard deviation of what each has of its own.
OTHER_MEAN, OTHER_LEVEL_SD, OTHER_SD = -0.4, 0.8, 0.4
# What undoes each of FaultProbabilities. Both encoders that count each edge twice are not among
# them: motors that are quick at small duties look the same.
SHIFTS = (HALF, 0.0), (0.0, HALF), (-HALF, 0.0), (0.0, -HALF), (HALF, HALF)
PRIORS = (*(HALF_PROBABILITY,) * 4, BOTH_PROBABILITY)
# Curve, load of both motors, and the probability of the pair.
MOTORS = tuple(
    (curve, moved, of_curve * of_load) for curve, of_curve in CURVES for moved, of_load in LOADS
)
HEALTHY = 1.0 - LOAD_PROBABILITY - OTHER_PROBABILITY - sum(PRIORS)


class Ratio(NamedTuple):
    """Logarithm of the edges counted over those explained, and what it depends on."""

    value: float
    friction: float
    """edges that friction takes, relative to those explained"""
    load: float
    """edges that a load of all of the duty takes, relative to those explained"""
    variance: float
    """without that of friction and curve"""

    @classmethod
    def of(cls, edges: EdgeRatio) -> Ratio:
        """The ratio of sums of edges."""
        explained = edges.explained
        lag = LAG_SD * edges.transient / explained
        return cls(
            log(max(edges.counted, 1.0) / explained),
            edges.friction / explained,
            edges.load / explained,
            GAIN_SD * GAIN_SD + lag * lag,
        )


class ExplainedLostEdges(LostEdges):
    """Whether encoders count half or twice of the edges that the duties explain."""

    def __init__(self, left: SideConfig, right: SideConfig) -> None:
        super().__init__()
        self.left, self.right = ExplainedEdges(left), ExplainedEdges(right)
        self.driven = 0  # frames since the last comparison
        self.are_even = False
        """whether both wheels count as many edges as is explained, or both wrong alike"""

    def restart(self, encoders: Encoders) -> None:
        """Go on with a frame after a gap, or with the first one."""
        self.left.restart(encoders.time, encoders.left)
        self.right.restart(encoders.time, encoders.right)

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
        is_driven = self.left.update(time, frame.left, frame.left_edge, left, is_duty, left_duty)
        is_driven |= self.right.update(
            time, frame.right, frame.right_edge, right, is_duty, right_duty
        )
        if is_driven:
            self.driven += 1
            if self.driven == COMPARE_FRAMES:
                self.driven = 0
                self._compare_edges()

    def _compare_edges(self) -> None:
        left, right = self.left.ratio, self.right.ratio
        explained = min(left.explained, right.explained)
        self.are_even = False
        if explained < EVEN_MIN:
            return
        ratios = Ratio.of(left), Ratio.of(right)
        self.are_even = abs(ratios[0].value - ratios[1].value) < RATIO_LOG_MIN
        if explained < EXPLAINED_MIN:
            return
        faults = ratio_probabilities(*ratios)
        self._take(faults, EXPLAINED_PROBABILITY_MIN, COMPARE_FRAMES)


def ratio_probabilities(left: Ratio, right: Ratio) -> FaultProbabilities:
    """Probabilities of the faults by the edges counted over those explained of both wheels."""
    is_even = abs(left.value - right.value) < RATIO_LOG_MIN
    if is_even and left.value + right.value > -2.0 * LEVEL_LOG_MIN:
        return FaultProbabilities()
    healthy = OTHER_PROBABILITY * _density(
        (left.value - OTHER_MEAN, left.variance + OTHER_SD * OTHER_SD),
        (right.value - OTHER_MEAN, right.variance + OTHER_SD * OTHER_SD),
        OTHER_LEVEL_SD,
    )
    faults = [0.0] * len(SHIFTS)
    variance = LOAD_SD * LOAD_SD
    for curve, moved, weight in MOTORS:
        a, b = _beyond(left, curve, moved), _beyond(right, curve, moved)
        healthy += weight * (
            HEALTHY * _density(a, b)
            + 0.5 * LOAD_PROBABILITY * _density((a[0], a[1] + variance), b)
            + 0.5 * LOAD_PROBABILITY * _density(a, (b[0], b[1] + variance))
        )
        for index, (left_shift, right_shift) in enumerate(SHIFTS):
            if is_even and left_shift != right_shift:
                continue
            density = _density((a[0] + left_shift, a[1]), (b[0] + right_shift, b[1]))
            faults[index] += weight * PRIORS[index] * density
    return normalized(faults, healthy)


def _beyond(ratio: Ratio, curve: float, moved: float) -> tuple[float, float]:
    """What a curve and a load leave of a ratio, and its variance."""
    share = max(1.0 + curve * ratio.friction - moved * ratio.load, SHARE_MIN)
    own = (FRICTION_SD + CURVE_SD * curve) * ratio.friction / share
    load = COMMON_LOAD_SD * moved * ratio.load / share
    return ratio.value - log(share), ratio.variance + own * own + load * load


def _density(
    left: tuple[float, float], right: tuple[float, float], level_sd: float = LEVEL_SD
) -> float:
    """Of two values, each with its variance, and with a level in common: that of the battery."""
    level = level_sd * level_sd
    (x, xx), (y, yy) = left, right
    xx, yy = xx + level, yy + level
    determinant = xx * yy - level * level
    square = yy * x * x - 2.0 * level * x * y + xx * y * y
    return exp(-0.5 * square / determinant) / sqrt(determinant)
