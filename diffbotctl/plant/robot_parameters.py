"""The parameters of a plant, from the robot file, and what a driver does in a pulse."""

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

from diffbotctl.config.board_pins import SIMULATED
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS, OffState
from diffbotctl.config.motor_pulses import driver_code
from diffbotctl.config.robot import USUAL_BATTERY, Robot, measured_lag
from diffbotctl.control.speed_loop import SpeedGains, speed_gains
from diffbotctl.links.diffbot_frames import DriverCode
from diffbotctl.plant.imu_mounting import (
    UP,
    Direction,
    Directions,
    axis_direction,
    axis_directions,
)
from diffbotctl.plant.motor_bridge import IDEAL_BRIDGE, BridgeModel, bridge_model
from diffbotctl.plant.simulated_board import BoardKind
from diffbotctl.time import SECOND


class InputLevels(NamedTuple):
    """Shares of a pulse for which the inputs of a driver are high, all from its begin on."""

    enable: float = 1.0  # also of a driver without it
    in1: float = 0.0
    in2: float | None = None  # None: in1 is the direction


class PulseShares(NamedTuple):
    """What a driver does over a pulse; for the rest of it the motor is open."""

    duty: float  # positive where in1 drives
    shorted: float


def pulse_shares(states: Mapping[str, OffState], levels: InputLevels) -> PulseShares:
    """Shares of a pulse, by the truth table of a driver."""
    duty = shorted = 0.0
    ends = sorted({each for each in (*levels, 1.0) if each is not None and each > 0.0})
    for begin, end in pairwise((0.0, *ends)):
        enabled, first = levels.enable > begin, levels.in1 > begin
        second = levels.in2 > begin if levels.in2 is not None else not first
        if not enabled and states["enable_low"] == "open":
            continue
        if first == second:
            shorted += (end - begin) * (states["both_high" if first else "both_low"] == "shorted")
        elif enabled:
            duty += (end - begin) * (first - second)
        else:
            shorted += end - begin
    return PulseShares(duty, shorted)


def firmware_levels(driver: DriverCode, duty: float, is_held: bool) -> InputLevels:
    """The levels that our firmware gives a driver's inputs for `duty`.

    `is_held`: it brakes at rest; see motors.c.
    """
    size, is_forward = abs(duty), duty > 0.0
    brakes = is_held and not duty
    match driver:
        case DriverCode.PULSED_INPUTS:
            if not duty and not is_held:
                return InputLevels(0.0, 0.0, 0.0)
            low = 1.0 - size
            return InputLevels(1.0, 1.0, low) if is_forward else InputLevels(1.0, low, 1.0)
        case DriverCode.TWO_PWM:
            first, second = (size, 0.0) if is_forward else (0.0, size)
            return InputLevels(1.0, 1.0, 1.0) if brakes else InputLevels(1.0, first, second)
        case DriverCode.ENABLE_DIRECTION:
            return InputLevels(size, float(is_forward))
        case DriverCode.ENABLE_IN1_IN2:
            if not duty:
                return InputLevels(float(brakes), float(brakes), float(brakes))
            return InputLevels(size, float(is_forward), float(not is_forward))


class MountedSensor(NamedTuple):
    """Pose of a sensor in base_link (m, rad), and the name of its part."""

    name: str
    x: float
    y: float = 0.0
    heading: float = 0.0
    kind: str = "sharp_gp2y0a41sk0f"
    upside_down: bool = False


class PlantParameters(NamedTuple):
    """Parameters of a simulated robot.

    Lengths, `rated`, `disc` and `built_divider` are nominal values of the robot file. The others
    are settings of the board, which may have been calibrated.
    """

    track: float  # m
    left_diameter: float  # m
    right_diameter: float  # m
    rated: tuple[float, float]  # rad/s at full duty, left and right
    counts: tuple[int, int]  # per turn, left and right
    glitch: int  # ns
    deadman: int  # ns
    gains: tuple[SpeedGains, SpeedGains]  # of the board's speed loops, left and right
    lag: float | None = None  # s; of the slower motor, as the board knows it; None: unknown
    reversed: tuple[bool, bool] = (False, False)  # setting of the motor leads
    sensors: tuple[MountedSensor, ...] = ()
    falling: bool = False  # the encoders count falling edges instead of rising ones
    period: int | None = None  # ns between two frames; None: that of the kind of board
    disc: tuple[int, int] | None = None  # nominal slots of the discs; None: as many as `counts`
    # Outputs of the motor driver, and sockets of the encoders, that the board uses for left and
    # right; 0 is the one built for the left side, 1 for the right.
    channels: tuple[int, int] = (0, 1)
    sockets: tuple[int, int] = (0, 1)
    divider: float | None = None  # factor for the board's readings; None: no pin
    built_divider: float = 1.0  # nominal
    low: float = 0.0  # V
    full: float = USUAL_BATTERY  # V; nominal, at which the motors reach their rated speed
    # Share of the time without drive for which the motors are shorted, between pulses and at rest.
    shorted_between: float = 0.0
    shorted_at_rest: float = 0.0
    bridge: BridgeModel = IDEAL_BRIDGE  # of the motor driver
    has_encoders: bool = True
    is_skid_steered: bool = False  # four wheels, which slide in turns
    has_button: bool = False  # a stop button is connected to the board
    encoder_channels: int = 1
    every_edge: bool = False  # all four edges of a slot of two channels count, not one
    encoder_reversed: tuple[bool, bool] = (False, False)  # setting: two channels count down forward
    gyro_axes: Directions | None = None  # of the axes printed on the IMU; None: no IMU
    gyro_direction: Direction = UP  # of the axis that the settings state as up
    front: float = 0.0  # m, from the middle of the axle to the front of the body
    is_upward_checked: bool = True  # setting: that axis is compared with gravity


def board_kind(robot: Robot) -> BoardKind:
    """The kind of board that this robot has."""
    if robot.board.type == SIMULATED:
        return "simulated"
    if robot.link.protocol == "rosserial":
        return "stock"
    return "edges" if robot.board.edge_times else "counts"


def plant_parameters(
    robot: Robot, nominal: Robot | None = None, is_upward_checked: bool = True
) -> PlantParameters:
    """The parameters of a plant built as `nominal` states, with a board set up as `robot` states.

    Without `nominal` nothing was calibrated.
    """
    board, battery, drive = robot.board, robot.battery, robot.drive
    left, right = drive.left, drive.right
    nominal = nominal or robot
    built, upward = nominal.drive, nominal.simulation.gyro.axes or nominal.imu.axes
    return PlantParameters(
        track=built.track,
        left_diameter=built.left.wheel.diameter,
        right_diameter=built.right.wheel.diameter,
        rated=(built.left.motor.rated, built.right.motor.rated),
        counts=(left.encoder.counts, right.encoder.counts),
        glitch=round(left.encoder.glitch * SECOND),
        deadman=round(board.deadman * SECOND),
        gains=(speed_gains(left.motor), speed_gains(right.motor)),
        lag=measured_lag(robot),
        reversed=(left.motor.reversed, right.motor.reversed),
        period=round(SECOND / board.telemetry),
        falling=left.encoder.edge == "falling",
        sensors=tuple(
            MountedSensor(
                name,
                sensor.at.x,
                sensor.at.y,
                sensor.at.heading,
                sensor.type,
                sensor.upside_down,
            )
            for name, sensor in robot.sensors.items()
        ),
        disc=(built.left.encoder.slots, built.right.encoder.slots),
        divider=None if battery.pin is None else battery.divider or 1.0,
        built_divider=nominal.battery.divider or 1.0,
        low=battery.low,
        full=nominal.battery.full or USUAL_BATTERY,
        shorted_between=2.0 * _shorted(robot, 0.5),
        shorted_at_rest=_shorted(robot, 0.0),
        bridge=_bridge(nominal),
        has_encoders=bool(left.encoder.channels),
        is_skid_steered=built.wheelbase is not None,
        has_button=board.stop_button is not None,
        encoder_channels=built.left.encoder.channels,
        every_edge=left.encoder.counts > left.encoder.slots,
        encoder_reversed=(left.encoder.reversed, right.encoder.reversed),
        gyro_axes=None if nominal.imu.type is None else axis_directions(upward),
        gyro_direction=axis_direction(robot.imu.axes, upward),
        is_upward_checked=is_upward_checked,
        front=nominal.body.front,
        channels=_assignment(
            *(side.motor.enable or side.motor.in1 for side in (left, built.left, built.right))
        ),
        sockets=_assignment(*(side.encoder.pin for side in (left, built.left, built.right))),
    )


def _bridge(nominal: Robot) -> BridgeModel:
    """The bridges of the motor driver; ideal ones for a robot without one."""
    motor = nominal.drive.left.motor
    facts = MOTOR_DRIVERS.get(motor.driver)
    if facts is None:
        return IDEAL_BRIDGE
    full = nominal.battery.full or USUAL_BATTERY
    return bridge_model(facts.bridge, full, motor.stall_current)


def _shorted(robot: Robot, duty: float) -> float:
    """Share of each pulse for which the motors are shorted at this duty.

    At rest after pulses on the inputs our firmware brakes, and releases the motors when they have
    stood for a while, which makes no difference to them.
    """
    motor, code = robot.drive.left.motor, driver_code(robot)
    facts = MOTOR_DRIVERS.get(motor.driver)
    is_held = motor.idle == "brake" or code is DriverCode.PULSED_INPUTS
    if facts is None:
        return float(is_held and not duty)
    return pulse_shares(facts.states, firmware_levels(code, duty, is_held)).shorted


def _assignment(left_pin: object, built_left: object, built_right: object) -> tuple[int, int]:
    """The built side (0 left, 1 right) whose pins the board uses for left and for right.

    They are exchanged when the board's `left_pin` is the one built for the right side.
    """
    exchanged = str(left_pin) == str(built_right) != str(built_left)
    return (1, 0) if exchanged else (0, 1)
