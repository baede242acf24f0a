"""A plant of somebody else, as wheels and chassis of the simulated robot.

The shipped plants keep the wider interface of `DriveTrain` and `Chassis`: they time only the edges
that the board counts, and move the chassis only when something needs its pose. All edges and a pose
in each step make simulated runs slower, 1.6 times with 1320 counts per turn, and draw the slip at
other places.
"""

from __future__ import annotations

from collections import deque
from math import hypot
from random import Random

from diffbotctl.physics_model import Edge, MotorInput, Plant, PlantRobot, PlantStep
from diffbotctl.plant.chassis import Chassis
from diffbotctl.plant.drive_train import Edges
from diffbotctl.plant.encoder_disc import LevelChange, PulseFaults
from diffbotctl.plant.robot_parameters import PlantParameters
from diffbotctl.time import SECOND

NUMBER_MAX = 1e9  # m and rad
SHORTED_SHARE_MIN = 0.5  # of the time without drive, from which a motor counts as shorted


def plant_robot(parameters: PlantParameters) -> PlantRobot:
    """What the robot file states of the robot, for a plant."""
    return PlantRobot(
        parameters.track,
        (parameters.left_diameter, parameters.right_diameter),
        parameters.rated,
        parameters.disc or parameters.counts,
    )


def motor_input(duty: float, shorted: float) -> MotorInput:
    """The input of a motor that is shorted for this share of the time without drive."""
    if duty:
        return MotorInput(duty, "driven")
    return MotorInput(0.0, "shorted" if shorted >= SHORTED_SHARE_MIN else "open")


class OwnWheel:
    """A wheel of the plant; see `Wheel`."""

    taken_directions = ()

    def __init__(self, counted_level: int) -> None:
        self.angle = self.speed = 0.0
        self.level = 0
        self._counted_level, self._counts = counted_level, True
        self._changes: deque[LevelChange] | None = None

    @property
    def levels(self) -> tuple[int, ...]:
        """The level of the only channel."""
        return (self.level,)

    def take(self, edges: list[Edge]) -> Edges:
        """Times of the counted ones of `edges`."""
        for edge in edges:
            self.level = edge.level
            if self._changes is not None:
                self._changes.append(LevelChange(*edge))
        if not self._counts:
            return ()
        return [edge.time for edge in edges if edge.level == self._counted_level]

    def stop_counting(self) -> None:
        """Ignore all edges from now on."""
        self._counts = False

    def set_encoder_faults(self, faults: PulseFaults) -> None:
        """No effect: `check` refuses these faults."""

    def watch(self, on: bool) -> None:
        """Start or stop collecting what `changes` returns."""
        self._changes = deque() if on else None

    def changes(self, until: int) -> list[LevelChange]:
        """Changes of the watched pin since the last call, until `until`."""
        taken: list[LevelChange] = []
        while self._changes and self._changes[0].time <= until:
            taken.append(self._changes.popleft())
        return taken

    def changes_b(self, until: int) -> list[LevelChange]:
        """None: there is one channel."""
        return []

    def turn_by_hand(self, angle: float, speed: float) -> int:
        """No effect: no hand reaches the wheels of this plant."""
        return 0


class OwnDrive:
    """Both wheels of the plant; see `DriveTrain`."""

    dead_time = 0

    def __init__(self, plant: Plant, falling: bool) -> None:
        self.plant = plant
        self.wheels = (OwnWheel(int(not falling)), OwnWheel(int(not falling)))
        self.last = PlantStep((), (), 0.0, 0.0, 0.0, (0.0, 0.0))
        self._now, self._shorted = 0, (0.0, 0.0)

    def advance(self, until: int, duties: tuple[float, float]) -> tuple[Edges, Edges]:
        """Let time pass; see `DriveTrain`."""
        left, right = (motor_input(*each) for each in zip(duties, self._shorted, strict=True))
        step, before = self.plant.step(until, left, right), self.last.angles
        if not all(abs(each) <= NUMBER_MAX for each in (*step[2:5], *step.angles)):  # also no NaN
            name, pose = type(self.plant).__name__, f"pose {step[2:5]}, angles {step.angles}"
            raise ValueError(f"{name}.step returned a number that is not finite, or huge: {pose}")
        seconds = (until - self._now) / SECOND
        for wheel, angle, earlier in zip(self.wheels, step.angles, before, strict=True):
            wheel.angle = angle
            if seconds > 0.0:
                wheel.speed = (angle - earlier) / seconds
        self.last, self._now = step, until
        return self.wheels[0].take(list(step.left)), self.wheels[1].take(list(step.right))

    def set_shorted(self, left: float, right: float) -> None:
        """Short each motor for this share of the time without drive."""
        self._shorted = (left, right)

    def set_drag(self, left: float, right: float) -> None:
        """No effect: `check` refuses these faults."""

    def set_raised(self, is_raised: bool) -> None:
        """No effect."""


class OwnChassis(Chassis):
    """The pose of the plant."""

    __slots__ = ("_drive",)

    def __init__(self, built: Chassis, drive: OwnDrive) -> None:
        super().__init__(built.track, built.left_radius, built.right_radius, 0.0, Random(0))
        self._drive = drive

    def roll(self, left_angle: float, right_angle: float) -> None:
        """Move to where the plant has moved."""
        step = self._drive.last
        self.travel += hypot(step.x - self.x, step.y - self.y)
        self.turned += abs(step.heading - self.heading)
        self.x, self.y, self.heading = step.x, step.y, step.heading
