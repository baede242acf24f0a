"""Instruments that read what a simulated robot truly did, where a person would use their own.

They stand outside of every step: a step asks its question, and an answers file may have it answered
by a tape, a protractor, or the eye. Nothing here is handed to a block.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, hypot, pi, sin
from random import Random

from diffbotctl.errors import join_words
from diffbotctl.plant.simulated_robot import PlantTruth, SimulatedRobot
from diffbotctl.prompts.question import Answer, AnswerError, Question

# instrument -> quantities that it can read
READS = {
    "tape": ("forward", "left", "distance"),
    "protractor": ("turned", "facing"),
    "ruler": ("gap",),
    "meter": ("battery",),
    "eye": ("wheel",),
}
SEEN = pi / 36  # rad; a wheel that turned less than 5 degrees did not visibly turn
HAND_SPEED = 1.5 * pi  # rad/s; three quarters of a turn a second
HAND_MISS = 0.03  # rad, standard deviation: a mark on the tyre is stopped within a millimetre
PLACE_MISS = 0.001  # m, standard deviation: where a hand puts something beside a rule
HAND_REST = 1.0  # s until whoever turned a wheel has let go of it


class SimulatedTruth:
    """The truth of one plant since the last mark."""

    def __init__(
        self, plant: SimulatedRobot, wait: Callable[[float], object], chance: Random
    ) -> None:
        """`wait` lets the robot's time pass, in s; `chance` makes instruments blunt."""
        self._plant, self._wait, self._chance = plant, wait, chance
        self._mark: PlantTruth = plant.truth()
        self._gap = 0.0

    @property
    def truth(self) -> PlantTruth:
        """The plant's truth now, for figures that judge a calibration."""
        return self._plant.truth()

    def mark(self) -> None:
        """Readings are taken from how the robot stands now."""
        self._mark = self._plant.truth()

    def read(self, instrument: str, question: Question, noise: float) -> Answer:
        """What `instrument` shows for `question`. Raises AnswerError where it cannot."""
        able = READS.get(instrument)
        if able is None:
            raise AnswerError(f"there is no instrument '{instrument}': {join_words(READS)}")
        if question.quantity not in able:
            wanted = [name for name, reads in READS.items() if question.quantity in reads]
            other = f"; take the {wanted[0]}" if wanted else "; type it"
            raise AnswerError(f"no {instrument} can read this{other}")
        if question.quantity == "wheel":
            return question.read(self._turning())
        value = self._value(question.quantity) + self._chance.gauss(0.0, noise)
        return question.read(f"{value!r} {question.unit}")

    def roll(self, wheel: str, turns: float) -> None:
        """A hand turns one wheel, nearly as far as it was asked to."""
        angle = 2 * pi * turns + self._chance.gauss(0.0, HAND_MISS)
        side = 0 if wheel == "left" else 1
        end = self._plant.turn_by_hand(side, angle, HAND_SPEED)
        self._wait((end - self._plant.now) * 1e-9 + HAND_REST)

    def place(self, sensor: str, distance: float) -> None:
        """A hand puts a board across a sensor's axis, nearly at `distance` (m) from its front."""
        self._gap = distance + self._chance.gauss(0.0, PLACE_MISS)
        self._plant.put_before(sensor, self._gap)
        self._wait(HAND_REST)

    def _value(self, quantity: str) -> float:
        if quantity == "gap":
            return self._gap
        if quantity == "battery":
            return self._plant.supply()
        begun, now = self._mark.pose, self._plant.truth().pose
        x, y = now.x - begun.x, now.y - begun.y
        if quantity == "forward":
            return x * cos(begun.heading) + y * sin(begun.heading)
        if quantity == "left":
            return y * cos(begun.heading) - x * sin(begun.heading)
        if quantity == "distance":
            return hypot(x, y)
        turned = now.heading - begun.heading
        return turned if quantity == "turned" else (turned + pi) % (2 * pi) - pi

    def _turning(self) -> str:
        begun, now = self._mark, self._plant.truth()
        ways = {
            "left": now.left_angle - begun.left_angle,
            "right": now.right_angle - begun.right_angle,
        }
        moved = [side for side, way in ways.items() if abs(way) > SEEN]
        if not moved:
            return "none"
        forward = {ways[side] > 0.0 for side in moved}
        if len(forward) == 2:
            return "opposite ways"
        which = moved[0] if len(moved) == 1 else "both"
        return f"{which} {'forward' if forward.pop() else 'backward'}"
