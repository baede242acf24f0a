"""An encoder that loses every second edge, or counts each one twice, from the gains of the motors.

The speed loop of the board turns such a wheel at twice or half the speed that it counts, evenly:
its counts are as expected, only its motor seems to have half or twice the gain of the other one,
which has its calibrated gain times the level of the battery. A wheel that rubs can look alike. So
the share of the travel that may be wrong is a standard deviation: the root of the probability of
such an encoder, times the error that it makes.

Both encoders can count wrong alike, and do so where the robot file states twice the slots of the
discs: what then shows it is a level that neither the battery nor the weight of the robot gives its
motors. An encoder that works again leaves the pose wrong: what was likely once stays told until the
pose is set.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, log, sqrt
from typing import NamedTuple, Protocol

from diffbotctl.estimation.likelihood import normal_density

HALF = log(2.0)
# Standard deviations of the logarithm of the ratio of two calibrated gains: where load, wear and a
# board that does not report when edges came make it, and where an encoder does.
LOAD_SD, HALF_SD = 0.25, 0.15
LEVEL_SD = 0.2  # of the logarithm of what both gains share: the battery, full to empty, and its sag
# A robot may be heavy for its motors, which are calibrated with raised wheels: the probability, and
# mean and standard deviations, below and above it, of the logarithm of what both gains share then.
HEAVY_PROBABILITY, HEAVY_MEAN, HEAVY_SD, HEAVY_UPPER_SD = 0.4, -0.5, 0.6, 0.3
# By which the loads of both wheels differ, relative to the load. The less speed a load leaves, the
# more the ratio of the gains depends on it.
OWN_LOAD_SD = 0.2
# None of these: its probability, and standard deviations of the ratio and of what they share.
OTHER_PROBABILITY, OTHER_RATIO_SD, OTHER_LEVEL_SD = 0.02, 0.6, 1.0
HALF_PROBABILITY = 0.005  # of each fault of each wheel, before anything was counted
BOTH_PROBABILITY = 0.002  # of each fault of both wheels alike
# Of both encoders that count half: that the disc has fewer slots than the robot file states. Its
# pulses are as wide as others. Not of discs whose wheels' diameters were measured by their edges,
# nor of a change under way.
WRONG_SLOTS_SHARE = 0.5
# Natural log of the ratio of the likelihoods by the pulses of an encoder, above which gains and
# edges are compared however usual they are.
PULSE_RATIO_MAX = 1.0
# Below it such an encoder is not considered: what its wheel has to move may be the reason.
PROBABILITY_MIN = 0.1
# Logarithms of the ratio of both gains, and of what they share, within which working encoders
# explain them: whatever the variances, the probability of all faults is then below a quarter of
# that one. It need not be computed in each frame.
USUAL_RATIO_MAX, USUAL_LEVEL_MIN, USUAL_LEVEL_MAX = 0.3, -1.0, 0.25
FRAMES_MIN = 20  # in a row: a gain that changes suddenly needs some time to be found again
# What has been as likely as this stays told.
LASTING_PROBABILITY_MIN = 0.15
TEXT = (
    "counts {counts} the edges that its motor explains: {fault}, or the wheel {motion} "
    "than the other one"
)
LOST = TEXT.format(counts="half", fault="every second one is missing", motion="rubs more")
TWICE = TEXT.format(counts="twice", fault="each is counted twice", motion="turns more easily")
BOTH_TEXT = (
    "{counts} the edges that the motor explains are counted: {fault}, the disc has {slots} the "
    "`slots` of the robot file, or {supply}"
)
BOTH_LOST = BOTH_TEXT.format(
    counts="half of",
    fault="every second one is missing",
    slots="half",
    supply="the robot is too heavy for its motors or their battery",
)
BOTH_TWICE = BOTH_TEXT.format(
    counts="twice",
    fault="each is counted twice",
    slots="twice",
    supply="the motors are much faster than `rated`",
)


class FaultProbabilities(NamedTuple):
    """Of an encoder that loses every second edge, or counts each one twice."""

    left_lost: float = 0.0
    right_lost: float = 0.0
    left_twice: float = 0.0
    right_twice: float = 0.0
    both_lost: float = 0.0
    both_twice: float = 0.0

    def given_pulses(
        self, left: float, right: float, may_have_wrong_slots: bool
    ) -> FaultProbabilities:
        """With what the pulses of both encoders show: `PulseWidth.lost_log_ratio`.

        `may_have_wrong_slots`: whether discs with half the slots explain both, too.
        """
        faulty = sum(self, 0.0)
        if not faulty:
            return self
        healthy = 1.0 - faulty
        left, right = exp(left), exp(right)
        both = (1.0 - WRONG_SLOTS_SHARE) * left * right
        if may_have_wrong_slots:
            both += WRONG_SLOTS_SHARE
        return normalized(
            (
                left * self.left_lost,
                right * self.right_lost,
                self.left_twice,
                self.right_twice,
                both * self.both_lost,
                self.both_twice,
            ),
            healthy,
        )


# In the order of FaultProbabilities: what is told of the left and of the right wheel.
TOLD = (LOST, ""), ("", LOST), (TWICE, ""), ("", TWICE), (BOTH_LOST, BOTH_LOST), (BOTH_TWICE,) * 2
# The error of the travel by each fault, relative to it.
ERRORS = 1.0, 1.0, 0.5, 0.5, 1.0, 0.5


# What undoes them: added to the logarithm of the edges that the left and the right wheel count.
# Both encoders that count each edge twice are not among them: motors that are quick at small duties
# look the same.
SHIFTS = (HALF, 0.0), (0.0, HALF), (-HALF, 0.0), (0.0, -HALF), (HALF, HALF)
SHIFT_PRIORS = (*(HALF_PROBABILITY,) * 4, BOTH_PROBABILITY)


class PossibleFaults(NamedTuple):
    """Which faults nothing else rules out."""

    of_one: bool = True
    """one encoder, of one channel"""
    of_both: bool = True


ALL_FAULTS = PossibleFaults()


class Suspicion(NamedTuple):
    """What is told of both encoders."""

    probability: float = 0.0
    shares: tuple[float, float] = (0.0, 0.0)
    """standard deviation of the travel of the left and of the right wheel, relative to it"""
    texts: tuple[str, str] = ("", "")
    """what is wrong with each encoder, or an empty text"""


NO_SUSPICION = Suspicion()


class MotorGain(NamedTuple):
    """Gain of a motor relative to the robot file, with its variance."""

    value: float
    variance: float


class CountedWheel(Protocol):
    """A wheel whose travel and warning depend on lost edges."""

    lost_share: float
    lost_text: str


class LostEdges:
    """Whether the encoders count half or twice of their edges."""

    def __init__(self, may_have_wrong_slots: bool = True) -> None:
        self.may_have_wrong_slots = may_have_wrong_slots
        """whether both discs may have fewer slots than the robot file states"""
        self.frames = 0  # since when it is likely
        self.present = NO_SUSPICION
        self.lasting = NO_SUSPICION  # the likeliest since the pose was set
        self.pulse_ratios = (0.0, 0.0)
        """of the left and the right encoder, `PulseWidth.lost_log_ratio`"""
        self.possible = ALL_FAULTS

    @property
    def shows_missing_pulses(self) -> bool:
        """Whether the pulses of an encoder show that every second one may be missing."""
        return max(self.pulse_ratios) > PULSE_RATIO_MAX

    @property
    def probability(self) -> float:
        """That the pose is wrong by such an encoder."""
        return max(self.present.probability, self.lasting.probability)

    @property
    def shares(self) -> tuple[float, float]:
        """Standard deviation of the travel of the left and right wheel, relative to it."""
        left, right = self.present.shares
        lasting_left, lasting_right = self.lasting.shares
        return max(left, lasting_left), max(right, lasting_right)

    @property
    def texts(self) -> tuple[str, str]:
        """What is wrong with each encoder, or an empty text."""
        if self.present.probability or not self.lasting.probability:
            return self.present.texts
        left, right = (f"at times {text}" if text else "" for text in self.lasting.texts)
        return left, right

    def compare(self, left: MotorGain, right: MotorGain, are_even: bool = False) -> None:
        """Take the gains of both motors after a frame. `are_even`: the edges that both wheels count
        are as many as their duties explain, or both wrong alike."""
        faults = FaultProbabilities()
        if self.shows_missing_pulses or not are_usual(left, right):
            faults = gain_probabilities(left, right)
        if are_even:
            faults = FaultProbabilities(both_lost=faults.both_lost, both_twice=faults.both_twice)
        self._take(self._given_pulses(faults), PROBABILITY_MIN, 1)

    def pose_is_set(self) -> None:
        """What happened before does not matter any more."""
        self.lasting = NO_SUSPICION

    def tell(self, left: CountedWheel, right: CountedWheel) -> None:
        """Set share and text of both wheels."""
        left.lost_share, right.lost_share = self.shares
        left.lost_text, right.lost_text = self.texts

    def _is_possible(self, suspicion: Suspicion) -> bool:
        return self.possible.of_both if all(suspicion.texts) else self.possible.of_one

    def _given_pulses(self, faults: FaultProbabilities) -> FaultProbabilities:
        return faults.given_pulses(*self.pulse_ratios, self.may_have_wrong_slots)

    def _take(self, faults: FaultProbabilities, least: float, frames: int) -> None:
        """Suspect what has been likelier than `least` for some time, in the last `frames` too."""
        if not self.possible.of_one:
            faults = FaultProbabilities(both_lost=faults.both_lost, both_twice=faults.both_twice)
        if not self.possible.of_both:
            faults = faults._replace(both_lost=0.0, both_twice=0.0)
        if not self._is_possible(self.lasting):
            self.lasting = NO_SUSPICION
        probability = sum(faults, 0.0)
        self.frames = self.frames + frames if probability >= least else 0
        if self.frames < FRAMES_MIN:
            self.present = NO_SUSPICION
            return
        self.present = suspicion(faults)
        if probability > max(LASTING_PROBABILITY_MIN, self.lasting.probability):
            self.lasting = self.present


def suspicion(faults: FaultProbabilities) -> Suspicion:
    """What is told of the likeliest fault, with the probability of all of them."""
    probability = sum(faults, 0.0)
    index = faults.index(max(faults))
    texts, share = TOLD[index], sqrt(probability) * ERRORS[index]
    left, right = (share if text else 0.0 for text in texts)
    return Suspicion(probability, (left, right), texts)


def are_usual(left: MotorGain, right: MotorGain) -> bool:
    """Whether working encoders explain the gains of both motors, however badly these are known."""
    if left.value <= 0.0 or right.value <= 0.0:
        return False
    left_log, right_log = log(left.value), log(right.value)
    level = 0.5 * (left_log + right_log)
    is_even = abs(left_log - right_log) < USUAL_RATIO_MAX
    return is_even and USUAL_LEVEL_MIN < level < USUAL_LEVEL_MAX


def gain_probabilities(left: MotorGain, right: MotorGain) -> FaultProbabilities:
    """Probabilities of the faults by the gains of both motors."""
    if left.value <= 0.0 or right.value <= 0.0:
        return FaultProbabilities()
    ratio, mean = log(left.value / right.value), 0.5 * log(left.value * right.value)
    variance = left.variance / left.value**2 + right.variance / right.value**2

    def likelihood(ratio_error: float, mean_error: float, sd: float) -> float:
        load = OWN_LOAD_SD * max(exp(-mean_error) - 1.0, 0.0)
        own = sd * sd + load * load + variance
        heavy = mean_error - HEAVY_MEAN
        heavy_sd = HEAVY_SD if heavy < 0.0 else HEAVY_UPPER_SD
        weight = 2.0 * heavy_sd / (HEAVY_SD + HEAVY_UPPER_SD)  # twice that side's probability
        level = (1.0 - HEAVY_PROBABILITY) * normal_density(
            mean_error * mean_error, LEVEL_SD * LEVEL_SD + 0.25 * own
        ) + HEAVY_PROBABILITY * weight * normal_density(heavy * heavy, heavy_sd**2 + 0.25 * own)
        return normal_density(ratio_error * ratio_error, own) * level

    def one(ratio_shift: float, mean_shift: float) -> float:
        return HALF_PROBABILITY * likelihood(ratio - ratio_shift, mean - mean_shift, HALF_SD)

    def both(shift: float) -> float:
        return BOTH_PROBABILITY * likelihood(ratio, mean - shift, LOAD_SD)

    healthy = 1.0 - OTHER_PROBABILITY - 4.0 * HALF_PROBABILITY - 2.0 * BOTH_PROBABILITY
    half = 0.5 * HALF
    faults = (
        one(-HALF, -half),
        one(HALF, -half),
        one(HALF, half),
        one(-HALF, half),
        both(-HALF),
        both(HALF),
    )
    other_ratio = normal_density(ratio * ratio, OTHER_RATIO_SD**2 + variance)
    other_level = normal_density(mean * mean, OTHER_LEVEL_SD**2 + 0.25 * variance)
    other = OTHER_PROBABILITY * other_ratio * other_level
    return normalized(faults, healthy * likelihood(ratio, mean, LOAD_SD) + other)


def normalized(likelihoods: Sequence[float], healthy: float) -> FaultProbabilities:
    """Probabilities of all faults, by their likelihoods and that of working encoders."""
    total = healthy + sum(likelihoods, 0.0)
    if total <= 0.0:
        return FaultProbabilities()
    return FaultProbabilities(*(likelihood / total for likelihood in likelihoods))
