"""What the robot file says of a robot, as the plant needs it."""

from __future__ import annotations

from typing import NamedTuple

from diffbotctl.control.speed_loop import SpeedGains


class MountedSensor(NamedTuple):
    """Where a sensor sits, in base_link (m, rad), and which part it is."""

    name: str
    x: float
    y: float = 0.0
    heading: float = 0.0
    kind: str = "sharp_gp2y0a41sk0f"


class PlantParameters(NamedTuple):
    """What the robot file says of the robot, as the plant needs it.

    What is bolted and soldered (lengths, `rated`, `disc`) is what the file states; what the board
    is told (`slots`, `gains`, `reversed`, `channels`, `sockets`) may have been calibrated.
    """

    track: float  # m
    left_diameter: float  # m
    right_diameter: float  # m
    rated: float  # rad/s at full duty
    slots: int
    glitch: int  # ns
    deadman: int  # ns
    gains: tuple[SpeedGains, SpeedGains]  # of the board's speed loop, left and right
    reversed: tuple[bool, bool] = (False, False)  # motor leads, as the robot file has them
    sensors: tuple[MountedSensor, ...] = ()
    falling: bool = False  # the encoders count falling edges instead of rising ones
    period: int | None = None  # ns between two frames; None: that of the kind of board
    disc: int = 0  # slots that the file states; 0: as many as the board is told
    # Which of the driver's outputs (0, 1: stated for left, right) the board takes for each side,
    # and which of the encoders' sockets.
    channels: tuple[int, int] = (0, 1)
    sockets: tuple[int, int] = (0, 1)
    divider: float | None = None  # that the board's readings are multiplied with; None: no pin
    built_divider: float = 1.0  # that the file states
    low: float = 0.0  # V
