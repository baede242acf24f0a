"""The true pose of the simulated robot: exact arcs from the distances that its wheels roll."""

from __future__ import annotations

from math import cos, sin, sqrt
from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import Simulation
from diffbotctl.plant.robot_parameters import PlantParameters

SLIP_STEP = 0.004  # m of travel between draws of slip: fine against an encoder pitch of 10 mm

# Largest relative deviation of the track at which four wheels turn from the stated one.
SKID_TRACK_SPREAD = 0.2
PATCH_SIZE = 0.25  # m, of the floor's patches
# Slip on the two thirds that are smooth and the third that is rough, relative to the mean square.
SMOOTH_FACTOR, ROUGH_FACTOR = 0.5, 1.5811


class Pose(NamedTuple):
    """Position (m) and unwrapped heading (rad) of base_link in the frame `odom`."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    def to_parent(self, pose: Pose) -> Pose:
        """`pose`, given in the frame at this pose, in the parent of this frame."""
        c, s = cos(self.heading), sin(self.heading)
        return Pose(
            self.x + pose.x * c - pose.y * s,
            self.y + pose.x * s + pose.y * c,
            self.heading + pose.heading,
        )

    def from_parent(self, pose: Pose) -> Pose:
        """The inverse of `to_parent`."""
        c, s = cos(self.heading), sin(self.heading)
        x, y = pose.x - self.x, pose.y - self.y
        return Pose(x * c + y * s, y * c - x * s, pose.heading - self.heading)


class Chassis:
    """Two wheels on one axle, with slip. `x`, `y` in m, `heading` in rad, unwrapped.

    `travel` is the length of the path (m), `turned` the sum of all turning (rad).
    """

    __slots__ = (
        "_left_angle",
        "_left_grip",
        "_left_since_slip",
        "_play",
        "_right_angle",
        "_right_grip",
        "_right_since_slip",
        "_rng",
        "_slips",
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
        self,
        track: float,
        left_radius: float,
        right_radius: float,
        slip: float,
        rng: Random,
        backlash: float = 0.0,
    ) -> None:
        """`slip`: standard deviation in m per square root of a metre of each wheel's travel.

        `backlash`: play between encoder and wheel, rad.
        """
        self.track, self.left_radius, self.right_radius = track, left_radius, right_radius
        self.x = self.y = self.heading = 0.0
        self.travel = self.turned = 0.0
        self._slips, self._rng, self._play = (slip, slip), rng, 0.5 * backlash
        self._left_angle = self._right_angle = 0.0
        self._left_since_slip = self._right_since_slip = 0.0
        self._left_grip = self._right_grip = 1.0

    def slide(self, left: float, right: float) -> None:
        """From now on the wheels slide by these shares of what they turn, and roll the rest."""
        self._left_grip, self._right_grip = 1.0 - left, 1.0 - right

    def slip(self, left: float, right: float) -> None:
        """From now on the wheels slip so much at random: m after 1 m of travel."""
        self._slips = (left, right)

    @property
    def pose(self) -> Pose:
        """Pose in the frame `odom`."""
        return Pose(self.x, self.y, self.heading)

    def roll(self, left_angle: float, right_angle: float) -> None:
        """Move on to these angles of the encoders' shafts (rad since the start)."""
        if self._play:
            left_angle = self._behind_play(self._left_angle, left_angle)
            right_angle = self._behind_play(self._right_angle, right_angle)
        if left_angle == self._left_angle and right_angle == self._right_angle:
            return
        left = (left_angle - self._left_angle) * self.left_radius * self._left_grip
        right = (right_angle - self._right_angle) * self.right_radius * self._right_grip
        self._left_angle, self._right_angle = left_angle, right_angle
        if self._slips[0] or self._slips[1]:
            self._left_since_slip += abs(left)
            self._right_since_slip += abs(right)
            if self._left_since_slip > SLIP_STEP:
                left += self._draw_slip(self._left_since_slip, self._slips[0])
                self._left_since_slip = 0.0
            if self._right_since_slip > SLIP_STEP:
                right += self._draw_slip(self._right_since_slip, self._slips[1])
                self._right_since_slip = 0.0
        self._move(left, right)

    def _behind_play(self, wheel: float, shaft: float) -> float:
        """The angle of a wheel that stands at `wheel` when its shaft turns to `shaft`."""
        return min(max(wheel, shaft - self._play), shaft + self._play)

    def _move(self, left: float, right: float) -> None:
        """Move by an arc, from the distances that the wheels roll."""
        distance = 0.5 * (left + right)
        turn = (right - left) / self.track
        half = 0.5 * turn
        # The chord of an arc: its length by sin(h)/h, its direction the mean heading.
        chord = distance * (sin(half) / half) if half else distance
        middle = self.heading + half
        self.x += chord * cos(middle)
        self.y += chord * sin(middle)
        self.heading = middle + half
        self.travel += abs(distance)
        self.turned += abs(turn)

    def _draw_slip(self, travel: float, slip: float) -> float:
        return self._rng.gauss(0.0, slip * sqrt(travel))


class PatchedFloorChassis(Chassis):
    """A chassis on a floor with smooth and rough patches, moved along chords.

    A wheel slips much less on the one than on the other; over a long way the standard deviation is
    that of `slip`.
    """

    __slots__ = ("_seed",)

    def __init__(
        self,
        track: float,
        left_radius: float,
        right_radius: float,
        slip: float,
        rng: Random,
        backlash: float = 0.0,
    ) -> None:
        super().__init__(track, left_radius, right_radius, slip, rng, backlash)
        self._seed = rng.getrandbits(16)

    def _move(self, left: float, right: float) -> None:
        turn = (right - left) / self.track
        distance, middle = 0.5 * (left + right), self.heading + 0.5 * turn
        self.x += distance * cos(middle)
        self.y += distance * sin(middle)
        self.heading += turn
        self.travel += abs(distance)
        self.turned += abs(turn)

    def _draw_slip(self, travel: float, slip: float) -> float:
        row, column = int(self.x // PATCH_SIZE), int(self.y // PATCH_SIZE)
        is_rough = (row * 7919 + column * 104729 + self._seed) % 3 == 0
        factor = ROUGH_FACTOR if is_rough else SMOOTH_FACTOR
        return factor * super()._draw_slip(travel, slip)


def draw_chassis(parameters: PlantParameters, simulation: Simulation, rng: Random) -> Chassis:
    """Wheels and axle with their true lengths."""
    truth = simulation.geometry
    spread = truth.track_spread
    if parameters.is_skid_steered:
        spread = max(spread, SKID_TRACK_SPREAD)
    track = parameters.track * (1.0 + rng.uniform(-1.0, 1.0) * spread)
    radii = [
        0.5 * diameter * (1.0 + rng.uniform(-1.0, 1.0) * truth.diameter_spread)
        for diameter in (parameters.left_diameter, parameters.right_diameter)
    ]
    chassis = Chassis if simulation.equations == "exponential" else PatchedFloorChassis
    own_rng, backlash = Random(rng.getrandbits(64)), simulation.motor.backlash
    return chassis(track, radii[0], radii[1], simulation.slip, own_rng, backlash)
