"""Counts that the motors cannot have made: wrong `slots`, or motors unlike their `rated` speed.

A motor turns no faster than its rated speed allows at the duty in force, and a legitimate one no
slower than half of it, after what a heavy robot takes. Counts beyond that are made by a disc with
other slots than the robot file states, or by another motor; no encoder shows which of the two.

What a duty allows is only known of windings that are shorted between two pulses. With open ones a
motor is several times as fast at small duties, by as much as its friction leaves.
"""

from __future__ import annotations

from math import exp, log, sqrt

from diffbotctl.estimation.explained_edges import EdgeRatio
from diffbotctl.estimation.wheel_side import MotorConfig, known_decay

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
