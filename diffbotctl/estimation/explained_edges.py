"""Edges that an encoder counts, and those that the duty of its motor explains: sums over time.

Where both wheels count beyond that, the discs have other slots than the robot file states, or the
motors another rated speed; no encoder shows which of the two. A motor turns no faster than its
rated speed allows at the duty in force, and a legitimate one no slower than half of it, after what
a heavy robot takes. What a duty allows is only known of windings that are shorted between two
pulses. With open ones a motor is several times as fast at small duties, by as much as its friction
leaves.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from math import exp, log, pi, sqrt
from typing import NamedTuple

from diffbotctl.control.motor_curve import VISCOUS, MotorCurve
from diffbotctl.estimation.wheel_side import MotorConfig, SideConfig, known_decay

# Logarithms of the edges counted over those explained: of motors at half of their rated speed, and
# of half of the slots with motors 30 % below it. Healthy simulated robots reach 1.2.
LEAST, MOST = log(0.5), log(1.4)
HEAVY_LOAD = 0.2  # duty that moving the robot takes of both motors
EXPLAINED_MIN = 5.0  # edges
# Standard deviation of the log of a ratio by the friction, relative to the edges that it takes, and
# the number of them by which a ratio has to exceed MOST.
FRICTION_SD, SURE_SDS = 0.4, 0.3
COMPARISONS_MIN = 2  # in a row
# Of wrong slots rather than a motor: the goal is not given up, but never sure.
PROBABILITY = 0.4
TEXT = (
    "slots or motor: {edges} `rated` allows at the duty in force; `diffbotctl calibrate encoders` "
    "counts the slots"
)
FEW = TEXT.format(edges="less than half of the edges that")
MANY = TEXT.format(edges="far more edges than")


class CountMismatch:
    """Whether both wheels count edges that their motors cannot explain."""

    def __init__(self, is_linear: bool) -> None:
        """`is_linear`: whether the speed of both motors is linear in the duty."""
        self.is_linear = is_linear
        self.seen, self.comparisons = "", 0  # in a row, that show the same
        self.text = ""
        """what was found since the pose was set, or an empty text"""
        self.shares = (0.0, 0.0)
        """standard deviation of the travel of the left and the right wheel, relative to it"""

    @property
    def probability(self) -> float:
        """That the pose is wrong by the slots."""
        return PROBABILITY if self.text else 0.0

    def compare(self, left: EdgeRatio, right: EdgeRatio) -> None:
        """Take the sums of both wheels over the last seconds of driving."""
        seen = self._seen(left, right)
        self.comparisons = self.comparisons + 1 if seen == self.seen else 1
        self.seen = seen
        if seen and self.comparisons >= COMPARISONS_MIN:
            self.text, self.shares = seen, (_share(left), _share(right))

    def _seen(self, left: EdgeRatio, right: EdgeRatio) -> str:
        if min(left.explained, right.explained) < EXPLAINED_MIN:
            return ""
        if self.is_linear and min(_beyond_most(left), _beyond_most(right)) > 0.0:
            return MANY
        return FEW if max(_beyond_least(left), _beyond_least(right)) < 0.0 else ""


def is_linear(motor: MotorConfig) -> bool:
    """Whether its speed is linear in the duty, as measured or by its driver's data sheet."""
    return known_decay(motor) == "slow"


def _beyond_most(edges: EdgeRatio) -> float:
    """Logarithm by which the edges counted exceed those of a motor at its rated speed."""
    friction = FRICTION_SD * edges.friction / edges.explained
    return edges.log_ratio - SURE_SDS * friction - MOST


def _beyond_least(edges: EdgeRatio) -> float:
    """Logarithm by which the edges counted exceed those of a weak motor of a heavy robot."""
    return edges.without_load(HEAVY_LOAD)[0] - LEAST


def _share(edges: EdgeRatio) -> float:
    return sqrt(PROBABILITY) * abs(exp(-edges.log_ratio) - 1.0)


MEMORY_S = 5.0  # of driving, after which an edge weighs 1/e
# Duties beyond the static one at which classes of sums begin: what friction and a load take of the
# edges depends on the duty, and what a fault of the encoder takes does not.
CLASSES = 0.12, 0.25, 0.5
SPAN_MAX_S = 0.12  # the commands within a longer frame are not all known
DUTY_RATIO_MIN = 1.3  # of the dead band; with a smaller duty a wheel may stick and slip
# A duty. A line through the speeds of a motor that is quick at small duties may show no dead band,
# but the motor has one.
STATIC_MIN = 0.08
SHARE_MIN = 0.1  # of the edges explained, left by a load; less does not differ
STANDING_SPEED_RATIO = 0.05  # of the rated speed; a slower wheel without a duty stands


class EdgeRatio(NamedTuple):
    """Edges that were counted and explained, and what would change the latter."""

    counted: float
    explained: float
    friction: float  # edges that would be explained without friction, less `explained`
    load: float  # edges by which a load that takes all of a duty of 1 reduces `explained`

    @property
    def log_ratio(self) -> float:
        """Natural log of the edges counted over those explained."""
        return log(max(self.counted, 0.5) / self.explained)

    def without_load(self, load: float) -> tuple[float, float, float]:
        """Log of the ratio for a robot whose load takes this duty, and what friction and the load
        take of the edges that are left."""
        share = max(1.0 - load * self.load / self.explained, SHARE_MIN)
        left = self.explained * share
        return self.log_ratio - log(share), self.friction / left, load * self.load / left


def whole(ratios: Sequence[EdgeRatio]) -> EdgeRatio:
    """The sum of `ratios`."""
    return EdgeRatio(*(sum(values, 0.0) for values in zip(*ratios, strict=True)))


class ExplainedEdges:
    """Sums of one wheel by curve and class of duties; both curves where its motor's decay is
    unknown."""

    def __init__(self, side: SideConfig) -> None:
        motor = side.motor
        static = motor.loop.static
        fast_static = static if motor.friction is None else motor.friction
        slow = MotorCurve(static, motor.rated, motor.lag)
        fast = MotorCurve(fast_static, motor.rated, motor.lag, VISCOUS)
        curves = {"slow": [slow], "fast": [fast]}
        self.curves = curves.get(known_decay(motor) or "", [slow, fast])
        self.edges_per_rad = 0.5 * side.encoder.counts / pi
        self.static = max(static, STATIC_MIN)
        rate = motor.rated * self.edges_per_rad
        self.friction_rate = self.static / (1.0 - self.static) ** 2 * rate
        self.load_rate = rate / (1.0 - static)
        self.standing_speed = STANDING_SPEED_RATIO * motor.rated
        self.speeds = [0.0] * len(self.curves)  # rad/s, explained
        self.is_standing = True
        """no edge since it was at rest"""
        self.driven = 0.0
        """s, in which the sums have grown"""
        classes = range(len(CLASSES) + 1)
        self.sums = [[[0.0] * 4 for _ in classes] for _ in self.curves]

    @property
    def ratios(self) -> list[list[EdgeRatio]]:
        """The sums by curve and class."""
        return [[EdgeRatio(*sums) for sums in classes] for classes in self.sums]

    def add(self, span: float, edges: int, duty: float) -> None:
        """Take a frame of `span` (s) with `edges`, whose motor had the signed `duty`."""
        before = self.speeds[0]
        travels = []
        for index, curve in enumerate(self.curves):
            self.speeds[index], angle = curve.moved(self.speeds[index], duty, span)
            travels.append(abs(angle) * self.edges_per_rad)
        if edges:
            self.is_standing = False
        elif not duty and abs(self.speeds[0]) < self.standing_speed:
            self.is_standing = True
        if self.is_standing:  # how much more than the dead band it takes to start is not known
            if travels[0] > 1.0:
                self.speeds = [0.0] * len(self.curves)
            return
        size = abs(duty)
        if size > DUTY_RATIO_MIN * self.static and span < SPAN_MAX_S and before * duty > 0.0:
            self._sum(span, edges, size, travels)

    def _sum(self, span: float, edges: int, duty: float, travels: list[float]) -> None:
        self.driven += span
        fade, of_duty = exp(-span / MEMORY_S), bisect(CLASSES, duty - self.static)
        for curve, travel, classes in zip(self.curves, travels, self.sums, strict=True):
            for sums in classes:
                for index in range(4):
                    sums[index] *= fade
            steep = curve.steepness(duty) * span
            sums = classes[of_duty]
            sums[0] += edges
            sums[1] += travel
            sums[2] += (1.0 - duty) * self.friction_rate * steep
            sums[3] += self.load_rate * steep
