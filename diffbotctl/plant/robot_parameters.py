"""What the robot file says of a robot, as the plant needs it."""

from __future__ import annotations

from typing import NamedTuple

from diffbotctl.config.board_pins import SIMULATED
from diffbotctl.config.robot import Robot
from diffbotctl.control.speed_loop import SpeedGains, speed_gains
from diffbotctl.time import SECOND


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


def board_kind(robot: Robot) -> str:
    """`stock`, `counts`, `edges` or `simulated`: how this robot's board answers."""
    if robot.board.type == SIMULATED:
        return SIMULATED
    if robot.link.protocol == "rosserial":
        return "stock"
    return "edges" if robot.board.edge_times else "counts"


def plant_parameters(robot: Robot, nominal: Robot | None = None) -> PlantParameters:
    """What the plant must know: `nominal` is how the robot was built, `robot` what is told of it.

    Without `nominal` nothing was calibrated.
    """
    built = (nominal or robot).drive
    drive = robot.drive
    return PlantParameters(
        track=built.track,
        left_diameter=built.left.wheel.diameter,
        right_diameter=built.right.wheel.diameter,
        rated=built.left.motor.rated,
        slots=drive.left.encoder.slots,
        glitch=round(drive.left.encoder.glitch * SECOND),
        deadman=round(robot.board.deadman * SECOND),
        gains=(speed_gains(drive.left.motor), speed_gains(drive.right.motor)),
        reversed=(drive.left.motor.reversed, drive.right.motor.reversed),
        # A real board has its own beat; one that exists in the simulator alone has the file's.
        period=round(SECOND / robot.board.telemetry) if robot.board.type == SIMULATED else None,
        falling=drive.left.encoder.edge == "falling",
        sensors=tuple(
            MountedSensor(name, sensor.at.x, sensor.at.y, sensor.at.heading, sensor.type)
            for name, sensor in robot.sensors.items()
        ),
        disc=built.left.encoder.slots,
        divider=None if robot.battery.pin is None else robot.battery.divider or 1.0,
        built_divider=(nominal or robot).battery.divider or 1.0,
        low=robot.battery.low,
        channels=_taken(*(side.motor.enable for side in (drive.left, built.left, built.right))),
        sockets=_taken(*(side.encoder.pin for side in (drive.left, built.left, built.right))),
    )


def _taken(told: object, left: object, right: object) -> tuple[int, int]:
    """Which stated side's pins each side of the board takes: exchanged when the left one is
    `told` what was stated for the `right`."""
    return (1, 0) if str(told) == str(right) != str(left) else (0, 1)
