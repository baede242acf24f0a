"""The sections of a robot file: board, link, drive, sensors, body, limits, battery, calibration.

Lengths are in m, angles in rad, in the frame base_link (REP-103): x forward, y left, z up, origin
in the middle of the axle.
"""

from __future__ import annotations

from contextlib import suppress
from copy import copy
from math import pi
from typing import Any, Literal, cast

from diffbotctl.config.board_pins import BOARDS, SIMULATED
from diffbotctl.config.imu_chips import IMU_CHIPS
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS
from diffbotctl.config.simulation import LAG_MIN_S, ImuAxis, Simulation
from diffbotctl.geometry.distance_sensors import CUSTOM, ECHOES, SHARPS
from diffbotctl.geometry.lidars import LIDARS
from diffbotctl.links.diffbot_frames import SLOTS_MAXIMUM
from diffbotctl.links.link_protocol import USB_BAUD
from diffbotctl.params import REQUIRED, Choice, Count, Number, Param, Pin, Required, Section

RPM = 2 * pi / 60  # rad/s
SIDES = ("left", "right")
# Default glitch time: light barriers bounce for less than 2 ms; a quarter of a level leaves room
# for uneven slots, and for a wheel that turns faster than rated.
GLITCH_MAX_S, GLITCH_LEVEL_RATIO = 0.002, 0.25
# The coefficient of friction of rubber on a floor is at most about 1. A guard that relied on more
# braking would begin too late.
GRIP_MAX_M_S2 = 10.0
GRIP_REASON = "no tyre has grip for more; state mm/s2 if that was meant"

USUAL_BATTERY = 7.6  # V; two charged lithium cells under a light load

BoardSupply = Literal["vin", "regulator", "usb"]
Protocol = Literal["diffbot", "rosserial"]
BaudRate = Literal[9600, 19200, 38400, 57600, 115200]
Radio = Literal["hc05", "cable"]
LevelShift = Literal["divider", "direct"]
EchoLevel = Literal["direct", "divider"]
PulsedPins = Literal["inputs", "enable"]
IdleMode = Literal["coast", "brake"]
Decay = Literal["slow", "fast"]
CountedEdge = Literal["rising", "falling"]
Polarity = Literal["unproven", "checked_by_hand", "calibrated"]


def _pin(help: str, default: Required | None = None) -> Pin | None:
    """Declare a pin of the board, or `none`."""
    pin: Any = Param(Pin, none=True, default=default, help=help)
    return cast("Pin | None", pin)


class BoardSection(Section):
    """The microcontroller board."""

    type = Param(
        str,
        choices=(*BOARDS, SIMULATED),
        default="mega2560",
        help="Board type; it decides what each pin can do. simulated: no board, the robot exists "
        "only in the simulator and all its pins are `none`.",
    )
    telemetry = Number("Hz", "[1, 100]", 38.0, "Telemetry frame rate.")
    edge_times = Param(
        bool, default=True, help="Report the time of each encoder's last edge besides its count."
    )
    deadman = Number(
        "s",
        "[0.1, 0.5]",
        0.3,
        "The board stops the motors when no valid command has arrived for this time.",
        reason="a shorter time stops the robot between two commands, a longer one lets it drive on "
        "without any",
    )
    stop_button = _pin("Pin of an emergency stop button.")
    supply: BoardSupply = Choice(
        BoardSupply,
        "vin",
        "Board supply: the battery at VIN, the motor driver's 5 V regulator, or USB.",
    )


class LinkSection(Section):
    """The serial link between host and board."""

    protocol: Protocol = Choice(
        Protocol, "diffbot", "Protocol: diffbot (our firmware) or rosserial (the book's firmware)."
    )
    uart = Count("[0, 3]", 1, "Serial port of the board; 0 is the USB port.")
    baud: BaudRate = Choice(
        BaudRate,
        9600,
        "Baud rate of the port. A USB cable means 115200, also on the only port of an Uno or Nano.",
    )
    radio: Radio | None = Choice(
        Radio, None, "Device on the port; default: HC-05, on port 0 the USB cable."
    )
    level: LevelShift = Choice(
        LevelShift, "divider", "Connection of the board's 5 V signal to the module's 3.3 V input."
    )
    command_delay = Number(
        "s",
        "[0, 1]",
        0.015,
        "Delay of a command from host to motor: serial line, radio, board loop.",
    )
    command_jitter = Number(
        "s",
        "[0, 0.1]",
        0.0,
        "Standard deviation of command_delay; 0 when the board reports the time of effect.",
    )
    stamp_jitter = Number(
        "s",
        "[0, 0.1]",
        0.0,
        "Standard deviation of telemetry times; 0 when the board stamps its frames.",
    )

    @property
    def has_radio(self) -> bool:
        """True when a Bluetooth module is on the link's port; on the USB port only if stated."""
        return self.radio == "hc05" or (self.radio is None and self.uart != 0)


class WheelSection(Section):
    """One wheel."""

    diameter = Number("m", "(0.01, 0.5)", REQUIRED, "Rolling diameter.")
    width = Number("m", "(0.001, 0.3)", 0.026, "Tyre width.")
    mass = Number("kg", "(0, 10]", 0.035, "Mass.")


class SpeedLoopSection(Section):
    """Speed loop of one wheel: feed-forward and PI controller.

    It runs on the board, or on the host for a board that takes PWM duties.
    """

    static = Number("1", "[0, 0.75]", 0.1, "Duty that overcomes friction.")
    speed = Number(
        "", "(0, 0.75]", None, "Duty per rad/s above static; none: full duty at rated speed."
    )
    proportional = Number("", "[0, 0.75]", None, "Duty per rad/s of speed error; none: as `speed`.")
    integral = Number(
        "", "[0, 4.5]", None, "Duty per rad of angle error; none: `speed` over 0.1 s."
    )


class MotorSection(Section):
    """One motor and its channel of the motor driver."""

    driver = Param(
        str,
        choices=(*MOTOR_DRIVERS, "none"),
        default="l298n",
        help="Motor driver chip; none: simulated robots only.",
    )
    rated = Number("rad/s", "(0, inf)", 100 * RPM, "Wheel speed at full duty and full battery.")
    idle: IdleMode = Choice(
        IdleMode, "coast", "At rest: turn freely, or brake by shorted windings."
    )
    enable = _pin("Pin of the driver's EN input; carries the PWM.")
    in1 = _pin("Pin of the driver's first direction input, or first PWM input.", REQUIRED)
    in2 = _pin("Pin of its second direction input, or second PWM input; none: a driver with one.")
    pulses: PulsedPins | None = Choice(
        PulsedPins,
        None,
        "PWM on `inputs`, in1 and in2, so that the driver shorts the motor between the "
        "pulses, or on `enable`; none: on the inputs where driver and pins allow it.",
    )
    standby = _pin("Pin of the driver's standby input, for both motors.")
    stall_current = Number(
        "A",
        "(0, 100)",
        None,
        "Current of the blocked motor at full battery; none: unknown, not checked.",
    )
    reversed = Param(
        bool, default=False, help="True when in1 high and in2 low turns the wheel backwards."
    )
    lag = Number("s", f"[{LAG_MIN_S}, 2)", 0.1, "Time constant from duty to speed.")
    decay: Decay | None = Choice(
        Decay,
        None,
        "Current between two pulses of the driver: `slow`, the windings are shorted and the "
        "speed is linear in the duty; `fast`, they are open; none: unknown, odometry finds out.",
    )
    friction = Number(
        "1",
        "[0, 0.75]",
        None,
        "Duty at which friction just stops a turning wheel; none: as loop.static.",
    )
    loop = Param(SpeedLoopSection, default=SpeedLoopSection(), help="Speed loop of the wheel.")
    bridge_share = 0.0
    """share of the full battery's voltage that the driver's transistors take from a shorted motor;
    `fill_defaults` sets it"""
    is_shorted = False
    """whether the driver shorts the windings between two pulses; `fill_defaults` sets it"""


class EncoderSection(Section):
    """One wheel encoder."""

    channels = Param(
        int,
        choices=(0, 1, 2),
        default=1,
        help="Channels; two, A and B, show the direction; 0, also `encoder: none`: no encoder.",
    )
    slots = Count(
        f"[1, {SLOTS_MAXIMUM}]",
        REQUIRED,
        "Slots of the disc, or pulses of channel A, per turn of the wheel.",
        reason="the board keeps the counts per turn of a wheel in 16 bits",
    )
    counts_of_slot = 1  # counts that the board makes of a slot; `fill_defaults` sets it
    edge: CountedEdge = Choice(CountedEdge, "rising", "Edge that is counted.")
    glitch: Any = Number(  # `fill_defaults` sets it
        "s",
        "[0, 0.05]",
        None,
        "A level shorter than this is noise, and the edge at its end is not counted; default: "
        "a quarter of the shortest level at the rated speed, at most 2 ms; none with two channels.",
    )
    pin = _pin("Pin of the encoder's output, or channel A; needs an interrupt.", REQUIRED)
    pin_b = _pin("Pin of channel B; none: one channel.")
    reversed = Param(
        bool,
        default=False,
        help="True when two channels count down going forward: A and B are exchanged.",
    )
    open_share = Number(
        "1",
        "[0.1, 0.9]",
        None,
        "Share of a pitch between the edge counted forward and the one counted backward: the "
        "pin keeps its level between them; none: unknown, about half.",
    )

    @property
    def counts(self) -> int:
        """Counts per turn of the wheel; None when the slots could not be read."""
        return self.slots * self.counts_of_slot if self.slots else self.slots


class SideSection(Section):
    """One side of the drive. Its values override those that both sides share."""

    wheel = Param(WheelSection, shared=True, help="Wheel of this side.")
    motor = Param(MotorSection, shared=True, help="Motor of this side.")
    encoder = Param(EncoderSection, shared=True, help="Encoder of this side.")


class DriveSection(Section):
    """The two driven wheels. `wheel`, `motor` and `encoder` here apply to both sides."""

    type = Param(str, choices=("differential",), default="differential", help="Kind of drive.")
    track = Number("m", "(0.02, 2)", REQUIRED, "Distance between the tyre centres.")
    wheelbase = Number(
        "m",
        "(0.01, 2)",
        None,
        "Distance of front and rear axle of a robot with four driven wheels, whose `track` is "
        "the one at which it turns; none: two wheels.",
    )
    slip = Number(
        "m",
        "[0, 0.05)",
        0.0015,
        "Slip of each wheel: standard deviation after 1 m, growing with the square root.",
    )
    polarity: Polarity = Choice(
        Polarity,
        "unproven",
        "How it was verified that each motor turns its own wheel in the right direction.",
    )
    wheel: Any = Param(WheelSection, shared=True, default=None, help="Values of both wheels.")
    motor: Any = Param(MotorSection, shared=True, default=None, help="Values of both motors.")
    encoder: Any = Param(EncoderSection, shared=True, default=None, help="Values of both encoders.")
    left = Param(SideSection, help="The left side.")
    right = Param(SideSection, help="The right side.")


class MountSection(Section):
    """Pose of a sensor in the frame base_link."""

    x = Number("m", "(-2, 2)", 0.0, "Forward of the axle.")
    y = Number("m", "(-2, 2)", 0.0, "Left of the middle.")
    z = Number("m", "(-2, 2)", 0.0, "Above the axle; for drawings and the model.")
    heading = Number("rad", "", 0.0, "Direction; counter-clockwise from x.")


class CurveSection(Section):
    """Curve of a Sharp distance sensor: volts = a / (distance + b) + c."""

    a = Number("", "(0, 50]", None, "Slope, in V m.")
    b = Number("m", "[0, 1]", None, "Offset of the distance.")
    c = Number("V", "[-5, 5]", None, "Offset of the voltage.")


class SensorSection(Section):
    """One sensor. A board reads those at its pins; a source of the pipeline may read the others."""

    type = Param(
        str,
        choices=(*SHARPS, CUSTOM, *ECHOES, *LIDARS, "overhead_camera"),
        help="Part name. sharp_custom: another Sharp, with near, reach and curve; overhead_camera: "
        "sees the actual pose from above.",
    )
    pin = _pin(
        "Analog pin of its output; none: not read by the board, but by a source of the "
        "pipeline or in the simulator."
    )
    device: str | None = Param(
        str,
        none=True,
        default=None,
        help="Serial port of a lidar, best one in /dev/serial/by-id; the simulator does not use "
        "it. none: read by a source of the pipeline or in the simulator.",
    )
    upside_down = Param(
        bool,
        default=False,
        help="Whether a lidar is mounted upside down. Its heading is that of its zero angle.",
    )
    trigger = _pin("Pin of the trigger of an HC-SR04.")
    echo = _pin("Pin of its echo; needs a pin change interrupt.")
    level: EchoLevel = Choice(
        EchoLevel, "direct", "Connection of its 5 V echo to the pin; a Pico needs the divider."
    )
    near = Number("m", "(0, 1)", None, "Smallest distance of a sharp_custom.")
    reach = Number("m", "(0, 10)", None, "Largest distance of a sharp_custom.")
    at = Param(MountSection, default=MountSection(), help="Pose on the robot.")
    curve = Param(CurveSection, default=CurveSection(), help="Curve; default: the data sheet's.")


class ImuSection(Section):
    """The inertial sensor on the board's I2C bus; its gyro measures the turns of the robot."""

    type: str | None = Param(
        str, choices=tuple(IMU_CHIPS), none=True, default=None, help="Part name; none: no IMU."
    )
    address: int | None = Param(
        int,
        none=True,
        default=None,
        choices=(104, 105, 106, 107),
        help="I2C address. MPU: 104 (0x68), the default, or 105 (0x69) with AD0 at 3.3 V. "
        "LSM6: 106 (0x6A), the default, or 107 (0x6B) with SA0 at 3.3 V.",
    )
    axes: ImuAxis = Choice(
        ImuAxis,
        "z",
        "The axis printed on the part that points up; with a minus sign: that points down.",
    )
    at = Param(MountSection, default=MountSection(), help="Pose on the robot.")
    scale = Number(
        "1", "[0.9, 1.1]", 1.0, "True turn of the robot divided by the turn that the gyro measures."
    )


class CasterSection(Section):
    """The ball or caster that supports the robot besides its two wheels."""

    x = Number(
        "m",
        "(-2, 2)",
        None,
        "Contact point, forward of the axle; none: near the end that is farther away.",
    )
    diameter = Number("m", "(0, 0.5)", 0.02, "Ball diameter.")
    mass = Number("kg", "(0, 10]", 0.02, "Mass.")


class BodySection(Section):
    """The robot's outline, measured from the middle of the axle."""

    front = Number("m", "[0, 2)", 0.08, "Reach forward of the axle.")
    back = Number("m", "[0, 2)", 0.15, "Reach backward of the axle.")
    width = Number("m", "(0, 3)", 0.151, "Total width with tyres.")
    height = Number("m", "(0, 3)", 0.1, "Height of the chassis.")
    clearance = Number("m", "(0, 1)", 0.02, "Ground clearance.")
    mass = Number("kg", "(0, 200]", 0.7, "Mass without wheels and caster; used only by the model.")
    caster = Param(CasterSection, default=CasterSection(), help="Ball or caster.")


class LimitsSection(Section):
    """Motion limits."""

    speed = Number("m/s", "[0.005, inf)", 0.3, "Speed, forward and backward.")
    turn_rate = Number("rad/s", "[0.01, inf)", 4.0, "Turning speed.")
    acceleration = Number(
        "m/s2", f"[0.01, {GRIP_MAX_M_S2}]", 1.0, "Wheel acceleration.", reason=GRIP_REASON
    )
    braking = Number(
        "m/s2", f"[0.01, {GRIP_MAX_M_S2}]", 1.5, "Wheel deceleration.", reason=GRIP_REASON
    )


class BatterySection(Section):
    """The motor supply."""

    full = Number(
        "V", "(0, 60]", None, "Voltage when full, for the wiring checks; none: not checked."
    )
    pin = _pin("Analog pin that measures it through a divider.")
    divider = Number(
        "1", "[1, 20]", None, "Battery voltage divided by the voltage at the pin; none: unknown."
    )
    low = Number(
        "V",
        "[0, inf)",
        0.0,
        "Below it the battery is low: a warning, and a stop after 10 s; 0: never.",
    )


class Calibrated(Section):
    """One calibrated value, and where it comes from."""

    value: Any = Param(object, help="The value, written as in the field itself.")
    sd: Any = Param(object, none=True, default=None, help="Its standard deviation.")
    own_sd: Any = Param(
        object,
        none=True,
        default=None,
        help="Of a wheel diameter or the track: what is left of `sd` when the mean diameter of "
        "both wheels is known exactly. The rest is the scale that all lengths have in common.",
    )
    date: str | None = Param(str, none=True, default=None, help="Date of the calibration.")
    method: str | None = Param(
        str, none=True, default=None, help="The calibration that measured it."
    )
    volts: Any = Param(
        object,
        none=True,
        default=None,
        help="Battery voltage during the calibration, or `not measured`.",
    )
    recording: str | None = Param(
        str, none=True, default=None, help="Hash of the recording it was taken from."
    )
    pulses: PulsedPins | None = Choice(
        PulsedPins, None, "Of a motor: the pulses it was measured with, for which alone it is used."
    )
    simulated = Param(
        bool,
        default=False,
        help="Whether it was found on a simulated robot. A real port refuses the file then.",
    )


class Robot(Section):
    """One robot: its parts, their connections and their limits."""

    format = Param(int, choices=(1,), help="Version of the file format.")
    kind = Param(str, choices=("robot",), help="Kind of file.")
    include: Any = Param(
        object,
        none=True,
        default=None,
        help="A robot file, or a list of them, whose values this file overrides.",
    )
    vars: Any = Param(dict, default={}, help="Values used elsewhere as $name.")
    board = Param(BoardSection, default=BoardSection(), help="The microcontroller board.")
    link = Param(LinkSection, default=LinkSection(), help="The serial link to the board.")
    drive = Param(DriveSection, help="Wheels, motors and encoders.")
    sensors = Param(dict[str, SensorSection], default={}, help="Sensors by name.")
    imu = Param(ImuSection, default=ImuSection(), help="The inertial sensor.")
    body = Param(BodySection, default=BodySection(), help="The outline.")
    limits = Param(LimitsSection, default=LimitsSection(), help="Motion limits.")
    battery = Param(BatterySection, default=BatterySection(), help="The motor supply.")
    simulation = Param(Simulation, default=Simulation(), help="The simulated robot.")
    calibration = Param(
        dict[str, Calibrated], default={}, help="Calibrated values by field; `calibrate` writes it."
    )

    @property
    def has_board(self) -> bool:
        """Whether there is a board; without one the robot exists only in the simulator."""
        return self.board.type != SIMULATED


def measured_lag(robot: Robot) -> float | None:
    """Lag (s) of the slower motor; None when it has not been measured, and may be any."""
    if not all(f"drive.{side}.motor.lag" in robot.calibration for side in SIDES):
        return None
    return max(robot.drive.left.motor.lag, robot.drive.right.motor.lag)


def fill_defaults(robot: Robot) -> None:
    """Set what the file leaves to other fields, the board or data sheets.

    That is of each encoder the glitch time and the counts of a slot, of each motor the figures of
    its driver, of each Sharp sensor its curve. What could not be read leaves them as they are.
    """
    board = BOARDS.get(getattr(robot.board, "type", ""))
    for side in SIDES:
        with suppress(AttributeError, TypeError, ZeroDivisionError):
            own = field_value(robot, f"drive.{side}")
            encoder = own.encoder
            if board is not None and encoder.channels == 2:
                encoder.counts_of_slot = board.counts_of_slot
            if encoder.glitch is None:  # bounce of two channels counts up and down in turn
                is_one = encoder.channels == 1
                rated = own.motor.rated
                encoder.glitch = default_glitch(encoder.slots, rated) if is_one else 0.0
        with suppress(AttributeError):
            motor = field_value(robot, f"drive.{side}.motor")
            facts = MOTOR_DRIVERS.get(motor.driver)
            if facts is not None:
                full = robot.battery.full or USUAL_BATTERY
                motor.bridge_share = facts.bridge.threshold_share(full)
                motor.is_shorted = facts.bridge.off_state == "shorted"
    for sensor in (robot.sensors or {}).values():
        sharp, curve = SHARPS.get(getattr(sensor, "type", "")), getattr(sensor, "curve", None)
        if sharp is None or curve is None:
            continue
        sensor.curve = copy(curve)  # a curve that is not stated is one object for all sensors
        for name, value in zip("abc", sharp.curve, strict=True):
            if getattr(curve, name, value) is None:
                setattr(sensor.curve, name, value)


def default_glitch(slots: int, rated: float) -> float:
    """Glitch time (s) of an encoder with `slots` up to the `rated` wheel speed (rad/s)."""
    return min(GLITCH_MAX_S, GLITCH_LEVEL_RATIO * shortest_level(slots, rated))


def shortest_level(slots: int, rated: float) -> float:
    """Time (s) that the encoder's pin keeps a level at the `rated` wheel speed (rad/s).

    Slots and bars of the disc are taken as equally wide.
    """
    return pi / (slots * rated)


def line_baud(robot: Robot) -> int:
    """Baud rate of the line between host and board.

    A USB cable means 115200; so does a radio module beside it on a board whose USB port has its own
    rate.
    """
    board = BOARDS.get(robot.board.type)
    is_set = robot.link.uart != 0 or (
        board is not None and board.shares_usb and robot.link.has_radio
    )
    return robot.link.baud if is_set else USB_BAUD


def board_sensors(robot: Robot) -> dict[str, SensorSection]:
    """The sensors that the board of `robot` reads: those at its pins; a simulated board reads all.

    The others are read by a source of the pipeline.
    """
    reads_all = robot.board is not None and robot.board.type == SIMULATED
    return {
        name: sensor
        for name, sensor in (robot.sensors or {}).items()
        if sensor is not None and (reads_all or any((sensor.pin, sensor.trigger, sensor.echo)))
    }


def field_value(robot: Robot | None, path: str) -> Any:
    """The field of a robot at dotted `path`. Raises AttributeError or KeyError when absent."""
    value: Any = robot
    for step in path.split("."):
        value = value[step] if isinstance(value, dict) else getattr(value, step)
    return value
