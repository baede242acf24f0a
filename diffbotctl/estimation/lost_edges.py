"""An encoder that loses every second edge, or counts each one twice, from the gains of the motors.

The speed loop of the board turns such a wheel at twice or half the speed that it counts, evenly:
its counts are as expected, only its motor seems to have half or twice the gain of the other one,
which has its calibrated gain times the level of the battery. A wheel that rubs can look alike. So
the share of the travel that may be wrong is a standard deviation: the root of the probability of
such an encoder, times the error that it makes.
"""

from __future__ import annotations

from math import log, sqrt
from typing import NamedTuple, Protocol

from diffbotctl.estimation.likelihood import normal_density

HALF = log(2.0)
# Standard deviations of the logarithm of the ratio of two calibrated gains: where load, wear and a
# board that does not report when edges came make it, and where an encoder does.
LOAD_SD, HALF_SD = 0.25, 0.15
LEVEL_SD = 0.2  # of the logarithm of what both gains share: the battery, full to empty, and its sag
HALF_PROBABILITY = 0.005  # of each fault of each wheel, before anything was counted
# Below it such an encoder is not considered, as it is with hypotheses of the filter (1:20).
PROBABILITY_MIN = 0.05
FRAMES_MIN = 20  # in a row: a gain that changes suddenly needs some time to be found again
TEXT = (
    "counts {counts} the edges that its motor explains: {fault}, or the wheel {motion} "
    "than the other one"
)
LOST = TEXT.format(counts="half", fault="every second one is missing", motion="rubs more")
TWICE = TEXT.format(counts="twice", fault="each is counted twice", motion="turns more easily")


class MotorGain(NamedTuple):
    """Gain of a motor relative to the robot file, with its variance."""

    value: float
    variance: float


class CountedWheel(Protocol):
    """A wheel whose travel and warning depend on lost edges."""

    lost_share: float
    lost_text: str


class LostEdges:
    """Whether one of two encoders counts half or twice of its edges."""

    def __init__(self) -> None:
        self.frames = 0  # since when it is likely
        self.probability = 0.0
        self.shares = (0.0, 0.0)
        """standard deviation of the travel of the left and of the right wheel, relative to it"""
        self.texts = ("", "")
        """what is wrong with each encoder, or an empty text"""

    def compare(self, left: MotorGain, right: MotorGain) -> None:
        """Take the gains of both motors after a frame."""
        probability = half_probability(left, right)
        if not self._is_likely(probability >= PROBABILITY_MIN, 1):
            return
        gain = max((left.value, right.value), key=lambda value: abs(log(value)))
        self._set(probability, gain == left.value, gain < 1.0)

    def tell(self, left: CountedWheel, right: CountedWheel) -> None:
        """Set share and text of both wheels."""
        left.lost_share, right.lost_share = self.shares
        left.lost_text, right.lost_text = self.texts

    def _is_likely(self, is_likely: bool, frames: int) -> bool:
        """Whether it has been likely for some time, including the last `frames`."""
        self.frames = self.frames + frames if is_likely else 0
        self.probability, self.shares, self.texts = 0.0, (0.0, 0.0), ("", "")
        return self.frames >= FRAMES_MIN

    def _set(self, probability: float, is_left: bool, is_lost: bool) -> None:
        share = sqrt(probability) * (1.0 if is_lost else 0.5)
        text = LOST if is_lost else TWICE
        self.probability = probability
        self.shares = (share, 0.0) if is_left else (0.0, share)
        self.texts = (text, "") if is_left else ("", text)


def half_probability(left: MotorGain, right: MotorGain) -> float:
    """Probability that one of the encoders counts half or twice of its edges."""
    if left.value <= 0.0 or right.value <= 0.0:
        return 0.0
    ratio = abs(log(left.value / right.value))
    mean = 0.5 * log(left.value * right.value)
    variance = left.variance / left.value**2 + right.variance / right.value**2

    def likelihood(ratio_error: float, mean_error: float, sd: float) -> float:
        own = sd * sd + variance
        level = LEVEL_SD * LEVEL_SD + 0.25 * own
        return normal_density(ratio_error * ratio_error, own) * normal_density(
            mean_error * mean_error, level
        )

    load = (1.0 - 4.0 * HALF_PROBABILITY) * likelihood(ratio, mean, LOAD_SD)
    half = HALF_PROBABILITY * sum(
        likelihood(ratio - HALF, mean - shift, HALF_SD) for shift in (-0.5 * HALF, 0.5 * HALF)
    )
    return half / (half + load) if half > 0.0 else 0.0
