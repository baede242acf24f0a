"""The interface of the physics behind a simulated robot, for a plant of one's own.

`simulation: {plant: ./my_plant.py:MyPlant}` in a robot file puts one in place of the shipped ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

MotorState = Literal["driven", "shorted", "open"]


class PlantRobot(NamedTuple):
    """What the robot file states, left and right where there are two. Lengths in m.

    `rated`: speeds of the wheels at full duty, rad/s; `slots`: of the discs, per turn.
    """

    track: float
    diameters: tuple[float, float]
    rated: tuple[float, float]
    slots: tuple[int, int]


class MotorInput(NamedTuple):
    """What the board does to a motor: `duty` of the supply, -1 to 1, forward positive.

    At duty 0 the motor is shorted, which brakes it, or open.
    """

    duty: float
    state: MotorState


class Edge(NamedTuple):
    """The pin of an encoder of one channel goes to `level` (0 or 1) at `time` (ns)."""

    time: int
    level: int


class PlantStep(NamedTuple):
    """What has happened since the last step, and where the robot is then.

    `left`, `right`: the edges of the encoders, in order. `x`, `y` (m), `heading` (rad, unwrapped):
    pose in the frame in which the run began. `angles` (rad) of the wheels since the start.
    `has_contact`: it touches something.
    """

    left: Sequence[Edge]
    right: Sequence[Edge]
    x: float
    y: float
    heading: float
    angles: tuple[float, float]
    has_contact: bool = False


class Plant:
    """The physics of one simulated robot: wheels, motors and floor."""

    def __init__(self, robot: PlantRobot, seed: int) -> None:
        """Equal seeds have to give equal motion: draw from `random.Random(seed)` alone."""

    def step(self, until: int, left: MotorInput, right: MotorInput) -> PlantStep:
        """Let time pass until `until` (ns since the start), with constant inputs.

        Called often, with steps of any length, also of none.
        """
        raise NotImplementedError
