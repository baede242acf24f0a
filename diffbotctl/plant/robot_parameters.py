"""The parameters of a plant, from the robot file."""

from __future__ import annotations

from typing import NamedTuple

from diffbotctl.config.board_pins import SIMULATED
from diffbotctl.config.robot import Robot
from diffbotctl.control.speed_loop import SpeedGains, speed_gains
from diffbotctl.plant.simulated_board import BoardKind
from diffbotctl.time import SECOND


class MountedSensor(NamedTuple):
    """Pose of a sensor in base_link (m, rad), and the name of its part."""

    name: str
    x: float
    y: float = 0.0
    heading: float = 0.0
    kind: str = "sharp_gp2y0a41sk0f"


class PlantParameters(NamedTuple):
    """Parameters of a simulated robot.

    Lengths, `rated`, `disc` and `built_divider` are nominal values of the robot file. The others
    are settings of the board, which may have been calibrated.
    """

    track: float  # m
    left_diameter: float  # m
    right_diameter: float  # m
    rated: float  # rad/s at full duty
    slots: int
    glitch: int  # ns
    deadman: int  # ns
    gains: tuple[SpeedGains, SpeedGains]  # of the board's speed loops, left and right
    reversed: tuple[bool, bool] = (False, False)  # setting of the motor leads
    sensors: tuple[MountedSensor, ...] = ()
    falling: bool = False  # the encoders count falling edges instead of rising ones
    period: int | None = None  # ns between two frames; None: that of the kind of board
    disc: int = 0  # nominal slots of the discs; 0: as many as `slots`
    # Outputs of the motor driver, and sockets of the encoders, that the board uses for left and
    # right; 0 is the one built for the left side, 1 for the right.
    channels: tuple[int, int] = (0, 1)
    sockets: tuple[int, int] = (0, 1)
    divider: float | None = None  # factor for the board's readings; None: no pin
    built_divider: float = 1.0  # nominal
    low: float = 0.0  # V


def board_kind(robot: Robot) -> BoardKind:
    """The kind of board that this robot has."""
    if robot.board.type == SIMULATED:
        return "simulated"
    if robot.link.protocol == "rosserial":
        return "stock"
    return "edges" if robot.board.edge_times else "counts"


def plant_parameters(robot: Robot, nominal: Robot | None = None) -> PlantParameters:
    """The parameters of a plant built as `nominal` states, with a board set up as `robot` states.

    Without `nominal` nothing was calibrated.
    """
    board, battery, drive = robot.board, robot.battery, robot.drive
    left, right = drive.left, drive.right
    nominal = nominal or robot
    built = nominal.drive
    return PlantParameters(
        track=built.track,
        left_diameter=built.left.wheel.diameter,
        right_diameter=built.right.wheel.diameter,
        rated=built.left.motor.rated,
        slots=left.encoder.slots,
        glitch=round(left.encoder.glitch * SECOND),
        deadman=round(board.deadman * SECOND),
        gains=(speed_gains(left.motor), speed_gains(right.motor)),
        reversed=(left.motor.reversed, right.motor.reversed),
        # A real board has its own period; one that exists in the simulator alone has the file's.
        period=round(SECOND / board.telemetry) if board.type == SIMULATED else None,
        falling=left.encoder.edge == "falling",
        sensors=tuple(
            MountedSensor(name, sensor.at.x, sensor.at.y, sensor.at.heading, sensor.type)
            for name, sensor in robot.sensors.items()
        ),
        disc=built.left.encoder.slots,
        divider=None if battery.pin is None else battery.divider or 1.0,
        built_divider=nominal.battery.divider or 1.0,
        low=battery.low,
        channels=_assignment(*(side.motor.enable for side in (left, built.left, built.right))),
        sockets=_assignment(*(side.encoder.pin for side in (left, built.left, built.right))),
    )


def _assignment(left_pin: object, built_left: object, built_right: object) -> tuple[int, int]:
    """The built side (0 left, 1 right) whose pins the board uses for left and for right.

    They are exchanged when the board's `left_pin` is the one built for the right side.
    """
    exchanged = str(left_pin) == str(built_right) != str(built_left)
    return (1, 0) if exchanged else (0, 1)
