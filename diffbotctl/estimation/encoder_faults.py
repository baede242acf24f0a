"""Encoders that lose every second edge, or count each one twice: five hypotheses beside "healthy".

Such a wheel counts half, or twice, of the edges that the duty of its motor explains. What a duty
explains is uncertain: friction, the load of the robot, which motors calibrated with raised wheels
do not have, and the battery, which both motors share. One wheel may have a load of its own. A fault
that begins changes the ratio of a wheel within a second, by a factor that no load has so suddenly.
Where every second pulse is missing, the pulses are a quarter or three quarters as wide as the way
between two edges (`pulse_width.py`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import exp, log, sqrt
from typing import NamedTuple, Protocol

from diffbotctl.estimation.explained_edges import (
    MEMORY_S,
    CountMismatch,
    EdgeRatio,
    ExplainedEdges,
    whole,
)

HALF = log(2.0)
# Added to the logs of the ratios of the left and the right wheel, each undoes one fault: the left
# or the right encoder loses half, the left or the right one counts twice, both lose half. Two
# encoders that count twice are none of them: motors that are quick at small duties look the same.
SHIFTS = (HALF, 0.0), (0.0, HALF), (-HALF, 0.0), (0.0, -HALF), (HALF, HALF)
PRIORS = 0.005, 0.005, 0.005, 0.005, 0.002
ERRORS = 1.0, 1.0, 0.5, 0.5, 1.0  # of the travel by each fault, relative to it
# Duty that moving the robot takes of both motors, and its probability.
LOADS = (0.0, 0.4), (0.07, 0.2), (0.14, 0.15), (0.21, 0.15), (0.3, 0.1)
# Standard deviations of the log of a ratio: of one motor, of what both share (the battery), by its
# friction and by the load, relative to these, and of one class of duties; edges, by the cut at both
# ends of the time.
OWN_SD, LEVEL_SD, FRICTION_SD, LOAD_SD, CLASS_SD, ROUNDING_SD = 0.07, 0.2, 0.4, 0.15, 0.06, 0.6
CLASS_EDGES_MIN = 3.0  # explained; a class with less shows nothing
# A load that one wheel has of its own, and what is none of all these: probabilities and standard
# deviations. The latter is slower on average: a motor makes less speed than stated, seldom more.
ONE_LOADED, ONE_LOADED_SD = 0.1, 0.35
OTHER, OTHER_SD, OTHER_MEAN, OTHER_LEVEL_SD, OTHER_CLASS_SD = 0.02, 0.4, -0.4, 0.8, 0.2
# The same of a change within the last seconds: of one wheel, of both, a load that begins to act on
# one of them, and one that acts on both (another floor).
CHANGE_SD, CHANGE_ROUNDING_SD, CHANGE_LEVEL_SD = 0.1, 0.8, 0.1
CHANGE_LOADED, CHANGE_LOADED_SD, FLOOR, FLOOR_SD, FLOOR_OWN_SD = 0.1, 0.35, 0.1, 0.5, 0.15
# Logs within which working encoders explain both ratios.
EVEN_LOG_MAX, LEVEL_LOG_MIN = 0.3, -0.3
PULSES_SHOW_LOG = 1.0  # log of the ratio of likelihoods by the pulses; above it that does not hold
EDGES_MIN = 12.0  # that are explained
COMPARE_S = 0.2  # of driving
AGES = 1, 2, 3, 4, 6, 8, 12  # comparisons that a change may lie back
# Comparisons that show a ratio which lasts, and the log of the ratio of likelihoods by the pulses
# below which they are whole.
RECENT, WHOLE_LOG = 6, -3.0
COMPARISONS_MIN = 2  # in a row
PROBABILITY_MIN = 0.04  # below it no fault is considered
LASTING_MIN = 0.15  # what was as likely remains until the pose is set, which keeps what was lost
WRONG_SLOTS_SHARE = 0.5  # of both encoders that count half: discs with half of the stated slots
_TEXT = (
    "counts {counts} the edges that its motor explains: {fault}, or the wheel {motion} "
    "than the other one"
)
_LOST = _TEXT.format(counts="half", fault="every second one is missing", motion="rubs more")
_TWICE = _TEXT.format(counts="twice", fault="each is counted twice", motion="turns more easily")
BOTH_TEXT = (
    "half of the edges that the motor explains are counted: every second one is missing, the disc "
    "has half the `slots` of the robot file, or the robot is too heavy for its motors or their "
    "battery"
)
TEXTS = (_LOST, ""), ("", _LOST), (_TWICE, ""), ("", _TWICE), (BOTH_TEXT, BOTH_TEXT)

Probabilities = list[float]  # of the faults, in the order of SHIFTS
NONE: Probabilities = [0.0] * len(SHIFTS)


class PossibleFaults(NamedTuple):
    """Which faults nothing else rules out."""

    of_one: bool = True  # one encoder, of one channel
    of_both: bool = True


class CountedWheel(Protocol):
    """A wheel whose travel and warning depend on lost edges."""

    @property
    def explained(self) -> ExplainedEdges:
        """its edges, and those that its duty explains"""

    lost_share: float  # standard deviation of its travel, relative to it
    lost_text: str


class EncoderFaults:
    """Probabilities of the faults of both encoders."""

    def __init__(self, may_have_wrong_slots: bool = True, is_linear: bool = False) -> None:
        """`may_have_wrong_slots`: whether both discs may have other slots than stated. `is_linear`:
        whether the speed of both motors is linear in the duty."""
        self.may_have_wrong_slots = may_have_wrong_slots
        self.possible = PossibleFaults()
        self.pulse_log_ratios = (0.0, 0.0)
        """of the left and the right encoder, `PulseWidth.lost_log_ratio`"""
        self.compared = 0.0  # s of driving
        self.comparisons = 0  # in a row, with a fault
        self.present = self.lasting = NONE
        self.whole = [0, 0]
        """comparisons in a row in which the pulses of each encoder were whole"""
        self.states: deque[State] = deque(maxlen=AGES[-1])
        self.mismatch = CountMismatch(is_linear)

    @property
    def probability(self) -> float:
        """That the pose is wrong by such an encoder."""
        return max(sum(self.present, 0.0), sum(self.lasting, 0.0), self.mismatch.probability)

    def restart(self) -> None:
        """The wheels begin with new sums."""
        self.compared, self.comparisons, self.present = 0.0, 0, NONE
        self.whole = [0, 0]
        self.states.clear()

    def pose_is_set(self) -> None:
        """What happened before does not matter any more."""
        self.lasting = NONE
        self.mismatch.text = ""

    def update(self, left: CountedWheel, right: CountedWheel) -> None:
        """Compare the edges of both wheels, and set what follows for each."""
        driven = max(left.explained.driven, right.explained.driven)
        if driven >= self.compared + COMPARE_S:
            self.compared = driven
            self._compare(left.explained, right.explained)
        self._set(left, right)

    def _compare(self, left: ExplainedEdges, right: ExplainedEdges) -> None:
        pairs = list(zip(left.ratios, right.ratios, strict=True))
        now = State(left.driven, right.driven, [(whole(a), whole(b)) for a, b in pairs])
        found = NONE
        logs = [each for each in map(_logs, now.pairs) if each is not None]
        is_clear = max(self.pulse_log_ratios) > PULSES_SHOW_LOG
        if len(logs) == len(pairs) and (is_clear or not any(map(_is_usual, logs))):
            found = self._with_pulses(fault_probabilities(pairs))
        for age in AGES:
            if age <= len(self.states):
                change = self._with_pulses(now.change(self.states[-age]), is_change=True)
                found = max(found, change, key=sum)
        self.states.append(now)
        if self.may_have_wrong_slots and self.possible.of_both:
            self.mismatch.compare(*now.pairs[0])
        self._take(self._possible(found))
        self._refute(now, found)

    def _refute(self, now: State, found: Probabilities) -> None:
        """Drop what seemed to be a fault of one encoder and is the motor: its pulses were whole
        for the last second, in which the ratio was as unusual."""
        for index, ratio in enumerate(self.pulse_log_ratios):
            self.whole[index] = self.whole[index] + 1 if ratio < WHOLE_LOG else 0
        if max(self.whole) <= RECENT or len(self.states) <= RECENT:
            return
        logs = [_logs(pair) for pair in now.since(self.states[-1 - RECENT])]
        if any(each is None or _is_usual(each) for each in logs):
            return
        for index, comparisons in enumerate(2 * self.whole):
            if comparisons > RECENT:
                self.lasting[index] = min(self.lasting[index], found[index])

    def _take(self, found: Probabilities) -> None:
        is_likely = sum(found, 0.0) > PROBABILITY_MIN
        self.comparisons = self.comparisons + 1 if is_likely else 0
        self.present = found if self.comparisons >= COMPARISONS_MIN else NONE
        if sum(self.present, 0.0) > max(LASTING_MIN, sum(self.lasting, 0.0)):
            self.lasting = self.present
        self.lasting = self._possible(self.lasting)

    def _possible(self, faults: Probabilities) -> Probabilities:
        of_one, of_both = self.possible
        return [*(faults[:4] if of_one else NONE[:4]), faults[4] if of_both else 0.0]

    def _with_pulses(self, faults: Probabilities, is_change: bool = False) -> Probabilities:
        """`faults` with what the widths of the pulses show."""
        left, right = (exp(value) for value in self.pulse_log_ratios)
        share = WRONG_SLOTS_SHARE if self.may_have_wrong_slots and not is_change else 0.0
        both = (1.0 - WRONG_SLOTS_SHARE) * left * right + share
        # Edges of a bouncing pin come in pairs, and where both edges are counted, the level
        # after one of them is as often the other one: whole pulses show neither.
        likelihoods = (left, right, min(left, 1.0), min(right, 1.0), both)
        found = [each * likely for each, likely in zip(faults, likelihoods, strict=True)]
        return _normalized(found, 1.0 - sum(faults, 0.0))

    def _set(self, left: CountedWheel, right: CountedWheel) -> None:
        faults = self.present if sum(self.present, 0.0) >= sum(self.lasting, 0.0) else self.lasting
        probability = sum(faults, 0.0)
        index = faults.index(max(faults))
        texts = TEXTS[index] if probability > PROBABILITY_MIN else ("", "")
        if self.mismatch.text:
            for wheel, wrong in zip((left, right), self.mismatch.shares, strict=True):
                wheel.lost_text, wheel.lost_share = self.mismatch.text, wrong
            return
        share = sqrt(probability) * ERRORS[index]
        when = "" if sum(self.present, 0.0) > PROBABILITY_MIN else "at times "
        for wheel, text in zip((left, right), texts, strict=True):
            wheel.lost_text, wheel.lost_share = (when + text, share) if text else ("", 0.0)


Pair = tuple[Sequence[EdgeRatio], Sequence[EdgeRatio]]
"""ratios of the left and the right wheel, by class of duties"""


WholePair = tuple[EdgeRatio, EdgeRatio]  # the same in all classes together


class State(NamedTuple):
    """The sums of both wheels after so many seconds in which each was driven, by curve."""

    left_driven: float
    right_driven: float
    pairs: list[WholePair]

    def change(self, before: State) -> Probabilities:
        """Probabilities of faults that have begun since then."""
        pairs = zip(before.pairs, self.since(before), strict=True)
        return min((change_probabilities(then, now) for then, now in pairs), key=sum)

    def since(self, before: State) -> list[WholePair]:
        """What was added to the sums since then."""
        left, right = self.left_driven - before.left_driven, self.right_driven - before.right_driven
        return [
            (_since(now[0], then[0], left), _since(now[1], then[1], right))
            for now, then in zip(self.pairs, before.pairs, strict=True)
        ]


class Residual(NamedTuple):
    """What the ratios of a wheel show beyond one load."""

    value: float  # mean of the logs
    variance: float
    likelihood: float  # of the differences between the classes of duties


def fault_probabilities(pairs: Sequence[Pair]) -> Probabilities:
    """Of each fault by the ratios of the left and the right wheel in each class of duties, for each
    possible curve: the motors of both wheels are of one kind.

    A load or a curve that explains the ratios of all classes at once is likelier than one that does
    so in each of them by chance.
    """
    faults, healthy = [0.0] * len(SHIFTS), 0.0
    level, loaded = LEVEL_SD * LEVEL_SD, ONE_LOADED_SD * ONE_LOADED_SD
    other, other_level = OTHER_SD * OTHER_SD, OTHER_LEVEL_SD * OTHER_LEVEL_SD
    for left, right in pairs:
        a, b = _residual(left, 0.0, OTHER_CLASS_SD), _residual(right, 0.0, OTHER_CLASS_SD)
        density = _density(a.value - OTHER_MEAN, b.value - OTHER_MEAN, other, other, other_level)
        healthy += OTHER * a.likelihood * b.likelihood * density
        for load, probability in LOADS:
            a, b = _residual(left, load), _residual(right, load)
            weight = probability * a.likelihood * b.likelihood
            x, y, xx, yy = a.value, b.value, a.variance, b.variance
            one = _density(x, y, xx + loaded, yy, level) + _density(x, y, xx, yy + loaded, level)
            usual = (1.0 - ONE_LOADED) * _density(x, y, xx, yy, level)
            healthy += weight * (usual + 0.5 * ONE_LOADED * one)
            for index, (of_left, of_right) in enumerate(SHIFTS):
                likely = _density(x + of_left, y + of_right, xx, yy, level)
                faults[index] += weight * PRIORS[index] * likely
    return _normalized(faults, healthy)


def change_probabilities(before: WholePair, now: WholePair) -> Probabilities:
    """The same of a fault that has begun between the edges `before` and `now`.

    What a motor's calibration, the load of the robot and the battery do to the ratio, they did
    before too, but what friction and load take depends on the duty.
    """
    logs, old = _logs(now), _logs(before)
    if logs is None or old is None or _is_usual((logs[0] - old[0], logs[1] - old[1])):
        return NONE
    faults, healthy = [0.0] * len(SHIFTS), 0.0
    level, loaded = CHANGE_LEVEL_SD**2, CHANGE_LOADED_SD**2
    for load, probability in LOADS:
        (then_left, left, xx), (then_right, right, yy) = (
            _changed(*ratios, load) for ratios in zip(before, now, strict=True)
        )
        own = OWN_SD * OWN_SD + CHANGE_SD * CHANGE_SD
        weight = probability * _density(then_left, then_right, own, own, LEVEL_SD * LEVEL_SD)
        one = _density(left, right, xx + loaded, yy, level)
        one += _density(left, right, xx, yy + loaded, level)
        floor = _density(left, right, xx + FLOOR_OWN_SD**2, yy + FLOOR_OWN_SD**2, FLOOR_SD**2)
        usual = (1.0 - CHANGE_LOADED - FLOOR) * _density(left, right, xx, yy, level)
        healthy += weight * (usual + 0.5 * CHANGE_LOADED * one + FLOOR * floor)
        for index, (of_left, of_right) in enumerate(SHIFTS):
            likely = _density(left + of_left, right + of_right, xx, yy, level)
            faults[index] += weight * PRIORS[index] * likely
    return _normalized(faults, healthy)


def _changed(before: EdgeRatio, now: EdgeRatio, load: float) -> tuple[float, float, float]:
    """Log of the ratio before for a robot with this load, its change, and the change's variance."""
    (then, friction, of_load), (value, friction_now, of_load_now) = (
        ratio.without_load(load) for ratio in (before, now)
    )
    variance = (
        CHANGE_SD**2
        + (CHANGE_ROUNDING_SD / min(before.explained, now.explained)) ** 2
        + (FRICTION_SD * (friction_now - friction)) ** 2
        + (LOAD_SD * (of_load_now - of_load)) ** 2
    )
    return then, value - then, variance


def _logs(pair: WholePair) -> tuple[float, float] | None:
    """Logs of the ratios of both wheels, where enough edges are explained."""
    left, right = pair
    if min(left.explained, right.explained) < EDGES_MIN:
        return None
    return left.log_ratio, right.log_ratio


def _since(now: EdgeRatio, then: EdgeRatio, driven: float) -> EdgeRatio:
    """What was added to the sums `then` in `driven` seconds."""
    fade = exp(-driven / MEMORY_S)
    return EdgeRatio(*(max(a - fade * b, 0.0) for a, b in zip(now, then, strict=True)))


def _residual(ratios: Sequence[EdgeRatio], load: float, class_sd: float = CLASS_SD) -> Residual:
    """What a load leaves of the ratios of a wheel, by class of duties."""
    weight = mean = square = 0.0
    product = 1.0
    for ratio in ratios:
        if ratio.explained < CLASS_EDGES_MIN:
            continue
        value, friction, of_load = ratio.without_load(load)
        variance = (
            class_sd * class_sd
            + (ROUNDING_SD / max(ratio.counted, 1.0)) ** 2
            + (FRICTION_SD * friction) ** 2
            + (LOAD_SD * of_load) ** 2
        )
        weight += 1.0 / variance
        mean += value / variance
        square += value * value / variance
        product *= variance
    scatter = square - mean * mean / weight
    likelihood = exp(-0.5 * scatter) / sqrt(product * weight)
    return Residual(mean / weight, 1.0 / weight + OWN_SD * OWN_SD, likelihood)


def _is_usual(logs: tuple[float, float]) -> bool:
    """Whether working encoders explain both logs."""
    left, right = logs
    return abs(left - right) < EVEN_LOG_MAX and left + right > 2.0 * LEVEL_LOG_MIN


def _density(x: float, y: float, xx: float, yy: float, level: float) -> float:
    """Of two normal values with variances of their own and one in common, times 2 pi."""
    xx, yy = xx + level, yy + level
    determinant = xx * yy - level * level
    square = yy * x * x - 2.0 * level * x * y + xx * y * y
    return exp(-0.5 * square / determinant) / sqrt(determinant)


def _normalized(faults: Sequence[float], healthy: float) -> Probabilities:
    total = healthy + sum(faults, 0.0)
    return [fault / total for fault in faults] if total > 0.0 else NONE
