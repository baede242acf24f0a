"""Where the simulated robot truly is: exact arcs from what its wheels roll on the ground."""

from __future__ import annotations

from math import cos, sin, sqrt
from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import Simulation
from diffbotctl.plant.robot_parameters import PlantParameters

SLIP_STEP = 0.004  # m of travel between draws of slip: fine against a tick of 10 mm


class Pose(NamedTuple):
    """Position (m) and unwrapped heading (rad) of base_link in the frame `odom`."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0


class Chassis:
    """Two wheels on one axle, with slip. `x`, `y` in m, `heading` in rad, unwrapped."""

    __slots__ = (
        "_chance",
        "_due_left",
        "_due_right",
        "_left",
        "_right",
        "_slip",
        "heading",
        "left_radius",
        "right_radius",
        "track",
        "travel",
        "turned",
        "x",
        "y",
    )

    def __init__(
        self, track: float, left_radius: float, right_radius: float, slip: float, chance: Random
    ) -> None:
        """`slip`: standard deviation in m per square root of a metre of each wheel's travel."""
        self.track, self.left_radius, self.right_radius = track, left_radius, right_radius
        self.x = self.y = self.heading = 0.0
        self.travel = self.turned = 0.0
        self._slip, self._chance = slip, chance
        self._left = self._right = 0.0
        self._due_left = self._due_right = 0.0

    def roll(self, left: float, right: float) -> None:
        """Move on to the wheel angles `left` and `right` (rad since the start)."""
        if left == self._left and right == self._right:
            return
        ahead_left = (left - self._left) * self.left_radius
        ahead_right = (right - self._right) * self.right_radius
        self._left, self._right = left, right
        if self._slip:
            self._due_left += abs(ahead_left)
            self._due_right += abs(ahead_right)
            if self._due_left > SLIP_STEP:
                ahead_left += self._slipped(self._due_left)
                self._due_left = 0.0
            if self._due_right > SLIP_STEP:
                ahead_right += self._slipped(self._due_right)
                self._due_right = 0.0
        ahead = 0.5 * (ahead_left + ahead_right)
        turn = (ahead_right - ahead_left) / self.track
        half = 0.5 * turn
        # The chord of an arc: its length by sin(h)/h, its direction the mean heading.
        chord = ahead * (sin(half) / half) if half else ahead
        middle = self.heading + half
        self.x += chord * cos(middle)
        self.y += chord * sin(middle)
        self.heading = middle + half
        self.travel += abs(ahead)
        self.turned += abs(turn)

    def _slipped(self, travel: float) -> float:
        return self._chance.gauss(0.0, self._slip * sqrt(travel))


def draw_body(machine: PlantParameters, simulation: Simulation, chance: Random) -> Chassis:
    """Wheels and axle, as they were really made."""
    truth = simulation.geometry
    track = machine.track * (1.0 + chance.uniform(-1.0, 1.0) * truth.track_spread)
    radii = [
        0.5 * diameter * (1.0 + chance.uniform(-1.0, 1.0) * truth.diameter_spread)
        for diameter in (machine.left_diameter, machine.right_diameter)
    ]
    return Chassis(track, radii[0], radii[1], simulation.slip, Random(chance.getrandbits(64)))
