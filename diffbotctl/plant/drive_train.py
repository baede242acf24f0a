"""What a simulated robot needs of its wheels, and the wheels that follow exact exponentials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from diffbotctl.plant.encoder_disc import LevelChange, PulseFaults
from diffbotctl.plant.wheel import WheelModel

Edges = Sequence[int]


class Wheel(Protocol):
    """One wheel: `angle` (rad since the start, forward positive), `speed` (rad/s) and its pin."""

    angle: float
    speed: float

    @property
    def level(self) -> int:
        """Level of the encoder's pin."""
        ...

    @property
    def levels(self) -> tuple[int, ...]:
        """Levels of the pins of all channels."""
        ...

    @property
    def taken_directions(self) -> Sequence[int]:
        """1 or -1: of the edges that the drive has returned last; empty with one channel."""
        ...

    def stop_counting(self) -> None:
        """Ignore all edges from now on, for a run that looks at the truth alone."""
        ...

    def set_encoder_faults(self, faults: PulseFaults) -> None:
        """What is wrong with its encoder of one channel from now on."""
        ...

    def watch(self, on: bool) -> None:
        """Start or stop collecting what `changes` returns."""
        ...

    def changes(self, until: int) -> list[LevelChange]:
        """Changes of the watched pin since the last call, until `until`; after `advance`."""
        ...

    def changes_b(self, until: int) -> list[LevelChange]:
        """The same of channel B; none with one channel."""
        ...

    def turn_by_hand(self, angle: float, speed: float) -> int:
        """From now on a hand turns it by `angle` rad at `speed` rad/s. Returns its end, ns."""
        ...


class DriveTrain(Protocol):
    """Both wheels with their motors."""

    @property
    def wheels(self) -> Sequence[Wheel]:
        """Left and right."""
        ...

    def advance(self, until: int, duties: tuple[float, float]) -> tuple[Edges, Edges]:
        """Let time pass until `until` (ns) with a constant voltage at each motor.

        `duties`: share of the full battery's voltage, forward positive. Returns the times (ns) of
        the counted edges of each wheel since the last call.
        """
        ...

    def set_shorted(self, left: float, right: float) -> None:
        """Short each motor for this share of the time without drive from now on; else it is open.

        The time without drive is that between two pulses, and all of it at duty 0.
        """
        ...

    def set_drag(self, left: float, right: float) -> None:
        """From now on each wheel drags: a friction torque, in duty that it takes to overcome."""
        ...

    def set_raised(self, is_raised: bool) -> None:
        """Raise the wheels off the ground, where no caster drags, or put them down."""
        ...

    @property
    def dead_time(self) -> int:
        """From a change of a duty to that of the torque, ns."""
        ...


class ExponentialDrive:
    """Two independent wheels, exact between two changes of their duties.

    Their speed is linear in the duty and decays without it, as with a driver that shorts the motor
    between two pulses and at duty 0.
    """

    def __init__(self, wheels: Sequence[WheelModel]) -> None:
        self.wheels = wheels

    def advance(self, until: int, duties: tuple[float, float]) -> tuple[Edges, Edges]:
        """Let time pass; see `DriveTrain`."""
        left, right = self.wheels
        return left.advance(until, duties[0]), right.advance(until, duties[1])

    def set_shorted(self, left: float, right: float) -> None:
        """No effect; see the class."""

    def set_drag(self, left: float, right: float) -> None:
        """Add friction; see `DriveTrain`."""
        for wheel, drag in zip(self.wheels, (left, right), strict=True):
            wheel.set_drag(drag)

    def set_raised(self, is_raised: bool) -> None:
        """No effect: there is no caster."""

    @property
    def dead_time(self) -> int:
        """None; see `DriveTrain`."""
        return 0
