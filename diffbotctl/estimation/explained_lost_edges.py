"""Encoders that lose every second edge, or count each one twice, by what their motors explain.

Such a wheel counts half, or twice, of the edges that the duty of its motor explains. What a duty
explains is uncertain. The dead band and the shape of the curve from duty to speed are the same for
both motors, nearly: one unknown for both takes them up. So do the battery, which both share, and a
load that one of them has alone.

It follows a change within a second or two. The gains that the filters of coarse encoders find
(`lost_edges`) follow within tens of seconds, but do not depend on that curve.
"""

from __future__ import annotations

from math import exp, log, log1p, sqrt
from typing import NamedTuple

from diffbotctl.estimation.explained_edges import EdgeRatio, ExplainedEdges
from diffbotctl.estimation.lost_edges import (
    BOTH_PROBABILITY,
    HALF,
    HALF_PROBABILITY,
    LEVEL_SD,
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
# Edges that must be explained: two or three frames of a fine encoder.
EXPLAINED_MIN = 20.0
# Error of the typical curve from duty to speed, in edges that friction takes, with probabilities:
# 0 is a linear motor with its dead band. Motors that are quick to coast between two pulses take
# several times the speed of it at small duties.
CURVES = ((0.0, 0.3), (0.5, 0.15), (1.0, 0.15), (2.0, 0.15), (4.0, 0.15), (8.0, 0.1))
# Standard deviations of the logarithm of a ratio: of a calibrated motor; by its own friction,
# relative to that of both, and to the error of the curve; of its lag.
GAIN_SD, FRICTION_SD, CURVE_SD, LAG_SD = 0.08, 0.4, 0.2, 0.2
# A load on one of the wheels: its probability, and its standard deviation.
LOAD_PROBABILITY, LOAD_SD = 0.1, 0.35
# What undoes each of FaultProbabilities. Both encoders that count each edge twice are not among
# them: motors that are quick at small duties look the same.
SHIFTS = (HALF, 0.0), (0.0, HALF), (-HALF, 0.0), (0.0, -HALF), (HALF, HALF)
PRIORS = (*(HALF_PROBABILITY,) * 4, BOTH_PROBABILITY)
HEALTHY = 1.0 - LOAD_PROBABILITY - sum(PRIORS)


class Ratio(NamedTuple):
    """Logarithm of the edges counted over those explained, and what it depends on."""

    value: float
    friction: float
    """edges that friction takes, relative to those explained"""
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
            GAIN_SD * GAIN_SD + lag * lag,
        )


class ExplainedLostEdges(LostEdges):
    """Whether encoders count half or twice of the edges that the duties explain."""

    def __init__(self, left: SideConfig, right: SideConfig) -> None:
        super().__init__()
        self.left, self.right = ExplainedEdges(left), ExplainedEdges(right)
        self.driven = 0  # frames since the last comparison

    def restart(self, encoders: Encoders) -> None:
        """Go on with a frame after a gap, or with the first one."""
        self.left.restart(encoders.time, encoders.left)
        self.right.restart(encoders.time, encoders.right)

    def update(self, frame: Encoders, since: int) -> None:
        """Take a frame whose commands are in effect since `since` (ns)."""
        is_duty, time = frame.command_kind == "duty", frame.time
        left, right = [(since, frame.left_command)], [(since, frame.right_command)]
        skipped = frame.skipped_command_time
        if skipped is not None:
            left.insert(0, (skipped, frame.skipped_left_command))
            right.insert(0, (skipped, frame.skipped_right_command))
        is_left_driven = self.left.update(time, frame.left, frame.left_edge, left, is_duty)
        if self.right.update(time, frame.right, frame.right_edge, right, is_duty) or is_left_driven:
            self.driven += 1
            if self.driven == COMPARE_FRAMES:
                self.driven = 0
                self._compare_edges()

    def _compare_edges(self) -> None:
        left, right = self.left.ratio, self.right.ratio
        if min(left.explained, right.explained) < EXPLAINED_MIN:
            return
        faults = ratio_probabilities(Ratio.of(left), Ratio.of(right))
        self._take(faults, EXPLAINED_PROBABILITY_MIN, COMPARE_FRAMES)


def ratio_probabilities(left: Ratio, right: Ratio) -> FaultProbabilities:
    """Probabilities of the faults by the edges counted over those explained of both wheels."""
    is_even = abs(left.value - right.value) < RATIO_LOG_MIN
    load = 0.0
    faults = [0.0] * len(SHIFTS)
    variance = LOAD_SD * LOAD_SD
    for curve, weight in CURVES:
        a, b = _beyond(left, curve), _beyond(right, curve)
        load += weight * (
            HEALTHY * _density(a, b)
            + 0.5 * LOAD_PROBABILITY * _density((a[0], a[1] + variance), b)
            + 0.5 * LOAD_PROBABILITY * _density(a, (b[0], b[1] + variance))
        )
        for index, (left_shift, right_shift) in enumerate(SHIFTS):
            if is_even and left_shift != right_shift:
                continue
            density = _density((a[0] + left_shift, a[1]), (b[0] + right_shift, b[1]))
            faults[index] += weight * PRIORS[index] * density
    return normalized(faults, load)


def _beyond(ratio: Ratio, curve: float) -> tuple[float, float]:
    """What a curve leaves of a ratio, and its variance."""
    share = ratio.friction / (1.0 + curve * ratio.friction)
    own = (FRICTION_SD + CURVE_SD * curve) * share
    return ratio.value - log1p(curve * ratio.friction), ratio.variance + own * own


def _density(left: tuple[float, float], right: tuple[float, float]) -> float:
    """Of two values, each with its variance, and with the level of the battery in common."""
    level = LEVEL_SD * LEVEL_SD
    (x, xx), (y, yy) = left, right
    xx, yy = xx + level, yy + level
    determinant = xx * yy - level * level
    square = yy * x * x - 2.0 * level * x * y + xx * y * y
    return exp(-0.5 * square / determinant) / sqrt(determinant)
