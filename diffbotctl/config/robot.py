"""The sections of a robot file: board, link, drive, sensors, body, limits, battery, calibration.

Lengths are in m, angles in rad, in the frame base_link (REP-103): x forward, y left, z up, origin
in the middle of the axle.
"""

from __future__ import annotations

from copy import copy
from math import pi
from typing import Any, Literal

from diffbotctl.config.board_pins import BOARDS, SIMULATED
from diffbotctl.config.imu_chips import IMU_CHIPS
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS
from diffbotctl.config.simulation import LAG_MIN_S, ImuAxis, Simulation
from diffbotctl.geometry.distance_sensors import CUSTOM, ECHOES, SHARPS
from diffbotctl.geometry.lidars import LIDARS
from diffbotctl.links.diffbot_frames import SLOTS_MAXIMUM
from diffbotctl.links.link_protocol import USB_BAUD
from diffbotctl.params import Choice, Param, Pin, Section

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


class BoardSection(Section):
    """The microcontroller board."""

    type = Param(
        str,
        choices=(*BOARDS, SIMULATED),
        default="mega2560",
        help="Board type; it decides what each pin can do. simulated: no board, the robot exists "
        "only in the simulator and all its pins are `none`.",
    )
    telemetry = Param(
        float, unit="Hz", default=38.0, minimum=1.0, maximum=100.0, help="Telemetry frame rate."
    )
    edge_times = Param(
        bool, default=True, help="Report the time of each encoder's last edge besides its count."
    )
    deadman = Param(
        float,
        unit="s",
        default=0.3,
        minimum=0.1,
        maximum=0.5,
        help="The board stops the motors when no valid command has arrived for this time.",
        reason="a shorter time stops the robot between two commands, a longer one lets it drive on "
        "without any",
    )
    stop_button: Pin | None = Param(
        Pin, none=True, default=None, help="Pin of an emergency stop button."
    )
    supply: BoardSupply = Choice(
        BoardSupply,
        default="vin",
        help="Board supply: the battery at VIN, the motor driver's 5 V regulator, or USB.",
    )


class LinkSection(Section):
    """The serial link between host and board."""

    protocol: Protocol = Choice(
        Protocol,
        default="diffbot",
        help="Protocol: diffbot (our firmware) or rosserial (the book's firmware).",
    )
    uart = Param(
        int, default=1, minimum=0, maximum=3, help="Serial port of the board; 0 is the USB port."
    )
    baud: BaudRate = Choice(
        BaudRate,
        default=9600,
        help="Baud rate of the port. A USB cable means 115200, also on the only port of an Uno or "
        "Nano.",
    )
    radio: Radio | None = Choice(
        Radio,
        none=True,
        default=None,
        help="Device on the port; default: HC-05, on port 0 the USB cable.",
    )
    level: LevelShift = Choice(
        LevelShift,
        default="divider",
        help="Connection of the board's 5 V signal to the module's 3.3 V input.",
    )
    command_delay = Param(
        float,
        unit="s",
        default=0.015,
        minimum=0.0,
        maximum=1.0,
        help="Delay of a command from host to motor: serial line, radio, board loop.",
    )
    command_jitter = Param(
        float,
        unit="s",
        default=0.0,
        minimum=0.0,
        maximum=0.1,
        help="Standard deviation of command_delay; 0 when the board reports the time of effect.",
    )
    stamp_jitter = Param(
        float,
        unit="s",
        default=0.0,
        minimum=0.0,
        maximum=0.1,
        help="Standard deviation of telemetry times; 0 when the board stamps its frames.",
    )

    @property
    def has_radio(self) -> bool:
        """True when a Bluetooth module is on the link's port; on the USB port only if stated."""
        return self.radio == "hc05" or (self.radio is None and self.uart != 0)


class WheelSection(Section):
    """One wheel."""

    diameter = Param(float, unit="m", above=0.01, below=0.5, help="Rolling diameter.")
    width = Param(float, unit="m", default=0.026, above=0.001, below=0.3, help="Tyre width.")
    mass = Param(float, unit="kg", default=0.035, above=0.0, maximum=10.0, help="Mass.")


class SpeedLoopSection(Section):
    """Speed loop of one wheel: feed-forward and PI controller.

    It runs on the board, or on the host for a board that takes PWM duties.
    """

    static = Param(
        float,
        unit="1",
        default=0.10,
        minimum=0.0,
        maximum=0.75,
        help="Duty that overcomes friction.",
    )
    speed: float | None = Param(
        float,
        none=True,
        default=None,
        above=0.0,
        maximum=0.75,
        help="Duty per rad/s above static; none: full duty at rated speed.",
    )
    proportional: float | None = Param(
        float,
        none=True,
        default=None,
        minimum=0.0,
        maximum=0.75,
        help="Duty per rad/s of speed error; none: as `speed`.",
    )
    integral: float | None = Param(
        float,
        none=True,
        default=None,
        minimum=0.0,
        maximum=4.5,
        help="Duty per rad of angle error; none: `speed` over 0.1 s.",
    )


class MotorSection(Section):
    """One motor and its channel of the motor driver."""

    driver = Param(
        str,
        choices=(*MOTOR_DRIVERS, "none"),
        default="l298n",
        help="Motor driver chip; none: simulated robots only.",
    )
    rated = Param(
        float,
        unit="rad/s",
        above=0.0,
        default=100 * RPM,
        help="Wheel speed at full duty and full battery.",
    )
    idle: IdleMode = Choice(
        IdleMode, default="coast", help="At rest: turn freely, or brake by shorted windings."
    )
    enable: Pin | None = Param(
        Pin, none=True, default=None, help="Pin of the driver's EN input; carries the PWM."
    )
    in1: Pin | None = Param(
        Pin,
        none=True,
        help="Pin of the driver's first direction input, or first PWM input.",
    )
    in2: Pin | None = Param(
        Pin,
        none=True,
        default=None,
        help="Pin of its second direction input, or second PWM input; none: a driver with one.",
    )
    pulses: PulsedPins | None = Choice(
        PulsedPins,
        none=True,
        default=None,
        help="PWM on `inputs`, in1 and in2, so that the driver shorts the motor between the "
        "pulses, or on `enable`; none: on the inputs where driver and pins allow it.",
    )
    standby: Pin | None = Param(
        Pin, none=True, default=None, help="Pin of the driver's standby input, for both motors."
    )
    stall_current: float | None = Param(
        float,
        unit="A",
        none=True,
        default=None,
        above=0.0,
        below=100.0,
        help="Current of the blocked motor at full battery; none: unknown, not checked.",
    )
    reversed = Param(
        bool, default=False, help="True when in1 high and in2 low turns the wheel backwards."
    )
    lag = Param(
        float,
        unit="s",
        default=0.1,
        minimum=LAG_MIN_S,
        below=2.0,
        help="Time constant from duty to speed.",
    )
    decay: Decay | None = Choice(
        Decay,
        none=True,
        default=None,
        help="Current between two pulses of the driver: `slow`, the windings are shorted and the "
        "speed is linear in the duty; `fast`, they are open; none: unknown, odometry finds out.",
    )
    friction: float | None = Param(
        float,
        unit="1",
        none=True,
        default=None,
        minimum=0.0,
        maximum=0.75,
        help="Duty at which friction just stops a turning wheel; none: as loop.static.",
    )
    breakaway: float | None = Param(
        float,
        unit="1",
        none=True,
        default=None,
        minimum=0.0,
        maximum=1.0,
        help="Duty at which a standing wheel begins to turn; none: unknown.",
    )
    loop = Param(SpeedLoopSection, default=SpeedLoopSection(), help="Speed loop of the wheel.")
    bridge_share = 0.0
    """share of the full battery's voltage that the driver's transistors take from a shorted motor;
    `fill_bridge` sets it"""
    is_shorted = False
    """whether the driver shorts the windings between two pulses; `fill_bridge` sets it"""


class EncoderSection(Section):
    """One wheel encoder."""

    channels = Param(
        int,
        choices=(0, 1, 2),
        default=1,
        help="Channels; two, A and B, show the direction; 0, also `encoder: none`: no encoder.",
    )
    slots = Param(
        int,
        minimum=1,
        maximum=SLOTS_MAXIMUM,
        reason="the board keeps the counts per turn of a wheel in 16 bits",
        help="Slots of the disc, or pulses of channel A, per turn of the wheel.",
    )
    counts_of_slot = 1
    """counts that the board makes of a slot; `fill_counts` sets it"""
    edge: CountedEdge = Choice(CountedEdge, default="rising", help="Edge that is counted.")
    glitch = Param(
        float,
        unit="s",
        none=True,
        default=None,
        minimum=0.0,
        maximum=0.05,
        help="A level shorter than this is noise, and the edge at its end is not counted; default: "
        "a quarter of the shortest level at the rated speed, at most 2 ms; none with two channels.",
    )
    pin: Pin | None = Param(
        Pin, none=True, help="Pin of the encoder's output, or channel A; needs an interrupt."
    )
    pin_b: Pin | None = Param(
        Pin, none=True, default=None, help="Pin of channel B; none: one channel."
    )
    reversed = Param(
        bool,
        default=False,
        help="True when two channels count down going forward: A and B are exchanged.",
    )
    slot_errors = Param(
        list[float],
        unit="1",
        default=[],
        minimum=-0.4,
        maximum=0.4,
        help="Angle error of each slot's edge in pitches, in forward order; empty: unknown.",
    )
    back_errors = Param(
        list[float],
        unit="1",
        default=[],
        minimum=-0.4,
        maximum=0.4,
        help="As slot_errors, for the edges counted backward, after open_share; empty: unknown.",
    )
    open_share: float | None = Param(
        float,
        unit="1",
        none=True,
        default=None,
        minimum=0.1,
        maximum=0.9,
        help="Share of a pitch between the edge counted forward and the one counted backward: the "
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
    track = Param(float, unit="m", above=0.02, below=2.0, help="Distance between the tyre centres.")
    wheelbase: float | None = Param(
        float,
        unit="m",
        none=True,
        default=None,
        above=0.01,
        below=2.0,
        help="Distance of front and rear axle of a robot with four driven wheels, whose `track` is "
        "the one at which it turns; none: two wheels.",
    )
    slip = Param(
        float,
        unit="m",
        default=0.0015,
        minimum=0.0,
        below=0.05,
        help="Slip of each wheel: standard deviation after 1 m, growing with the square root.",
    )
    polarity: Polarity = Choice(
        Polarity,
        default="unproven",
        help="How it was verified that each motor turns its own wheel in the right direction.",
    )
    wheel: Any = Param(WheelSection, shared=True, default=None, help="Values of both wheels.")
    motor: Any = Param(MotorSection, shared=True, default=None, help="Values of both motors.")
    encoder: Any = Param(EncoderSection, shared=True, default=None, help="Values of both encoders.")
    left = Param(SideSection, help="The left side.")
    right = Param(SideSection, help="The right side.")


class MountSection(Section):
    """Pose of a sensor in the frame base_link."""

    x = Param(float, unit="m", default=0.0, above=-2.0, below=2.0, help="Forward of the axle.")
    y = Param(float, unit="m", default=0.0, above=-2.0, below=2.0, help="Left of the middle.")
    z = Param(
        float,
        unit="m",
        default=0.0,
        above=-2.0,
        below=2.0,
        help="Above the axle; for drawings and the model.",
    )
    heading = Param(float, unit="rad", default=0.0, help="Direction; counter-clockwise from x.")


class CurveSection(Section):
    """Curve of a Sharp distance sensor: volts = a / (distance + b) + c."""

    a: float | None = Param(
        float, none=True, default=None, above=0.0, maximum=50.0, help="Slope, in V m."
    )
    b: float | None = Param(
        float,
        unit="m",
        none=True,
        default=None,
        minimum=0.0,
        maximum=1.0,
        help="Offset of the distance.",
    )
    c: float | None = Param(
        float,
        unit="V",
        none=True,
        default=None,
        minimum=-5.0,
        maximum=5.0,
        help="Offset of the voltage.",
    )


class SensorSection(Section):
    """One sensor. A board reads those at its pins; a source of the pipeline may read the others."""

    type = Param(
        str,
        choices=(*SHARPS, CUSTOM, *ECHOES, *LIDARS, "overhead_camera"),
        help="Part name. sharp_custom: another Sharp, with near, reach and curve; overhead_camera: "
        "sees the actual pose from above.",
    )
    pin: Pin | None = Param(
        Pin,
        none=True,
        default=None,
        help="Analog pin of its output; none: not read by the board, but by a source of the "
        "pipeline or in the simulator.",
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
    trigger: Pin | None = Param(
        Pin, none=True, default=None, help="Pin of the trigger of an HC-SR04."
    )
    echo: Pin | None = Param(
        Pin,
        none=True,
        default=None,
        help="Pin of its echo; needs a pin change interrupt.",
    )
    level: EchoLevel = Choice(
        EchoLevel,
        default="direct",
        help="Connection of its 5 V echo to the pin; a Pico needs the divider.",
    )
    near: float | None = Param(
        float,
        unit="m",
        none=True,
        default=None,
        above=0.0,
        below=1.0,
        help="Smallest distance of a sharp_custom.",
    )
    reach: float | None = Param(
        float,
        unit="m",
        none=True,
        default=None,
        above=0.0,
        below=10.0,
        help="Largest distance of a sharp_custom.",
    )
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
        default="z",
        help="The axis printed on the part that points up; with a minus sign: that points down.",
    )
    at = Param(MountSection, default=MountSection(), help="Pose on the robot.")
    scale = Param(
        float,
        unit="1",
        default=1.0,
        minimum=0.9,
        maximum=1.1,
        help="True turn of the robot divided by the turn that the gyro measures.",
    )


class CasterSection(Section):
    """The ball or caster that supports the robot besides its two wheels."""

    x: float | None = Param(
        float,
        unit="m",
        none=True,
        default=None,
        above=-2.0,
        below=2.0,
        help="Contact point, forward of the axle; none: near the end that is farther away.",
    )
    diameter = Param(float, unit="m", default=0.02, above=0.0, below=0.5, help="Ball diameter.")
    mass = Param(float, unit="kg", default=0.02, above=0.0, maximum=10.0, help="Mass.")


class BodySection(Section):
    """The robot's outline, measured from the middle of the axle."""

    front = Param(
        float, unit="m", minimum=0.0, below=2.0, default=0.08, help="Reach forward of the axle."
    )
    back = Param(
        float, unit="m", minimum=0.0, below=2.0, default=0.15, help="Reach backward of the axle."
    )
    width = Param(
        float, unit="m", above=0.0, below=3.0, default=0.151, help="Total width with tyres."
    )
    height = Param(
        float, unit="m", above=0.0, below=3.0, default=0.1, help="Height of the chassis."
    )
    clearance = Param(float, unit="m", above=0.0, below=1.0, default=0.02, help="Ground clearance.")
    mass = Param(
        float,
        unit="kg",
        above=0.0,
        maximum=200.0,
        default=0.7,
        help="Mass without wheels and caster; used only by the model.",
    )
    caster = Param(CasterSection, default=CasterSection(), help="Ball or caster.")


class LimitsSection(Section):
    """Motion limits."""

    speed = Param(
        float, unit="m/s", minimum=0.005, default=0.3, help="Speed, forward and backward."
    )
    turn_rate = Param(float, unit="rad/s", minimum=0.01, default=4.0, help="Turning speed.")
    acceleration = Param(
        float,
        unit="m/s2",
        minimum=0.01,
        maximum=GRIP_MAX_M_S2,
        default=1.0,
        help="Wheel acceleration.",
        reason=GRIP_REASON,
    )
    braking = Param(
        float,
        unit="m/s2",
        minimum=0.01,
        maximum=GRIP_MAX_M_S2,
        default=1.5,
        help="Wheel deceleration.",
        reason=GRIP_REASON,
    )


class BatterySection(Section):
    """The motor supply."""

    full: float | None = Param(
        float,
        unit="V",
        none=True,
        default=None,
        above=0.0,
        maximum=60.0,
        help="Voltage when full, for the wiring checks; none: not checked.",
    )
    pin: Pin | None = Param(
        Pin, none=True, default=None, help="Analog pin that measures it through a divider."
    )
    divider: float | None = Param(
        float,
        unit="1",
        none=True,
        default=None,
        minimum=1.0,
        maximum=20.0,
        help="Battery voltage divided by the voltage at the pin; none: unknown.",
    )
    low = Param(
        float,
        unit="V",
        minimum=0.0,
        default=0.0,
        help="Below it the battery is low: a warning, and a stop after 10 s; 0: never.",
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
        PulsedPins,
        none=True,
        default=None,
        help="Of a motor: the pulses it was measured with, for which alone it is used.",
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


def measured_lag(robot: Robot) -> float | None:
    """Lag (s) of the slower motor; None when it has not been measured, and may be any."""
    if not all(f"drive.{side}.motor.lag" in robot.calibration for side in SIDES):
        return None
    return max(robot.drive.left.motor.lag, robot.drive.right.motor.lag)


def fill_glitch(robot: Robot) -> None:
    """Set the glitch time of each encoder that does not state one.

    Values that could not be read leave it at None.
    """
    for side in SIDES:
        try:
            encoder = field_value(robot, f"drive.{side}.encoder")
            rated = field_value(robot, f"drive.{side}.motor.rated")
            if encoder.glitch is None:
                # Bounce of two channels counts up and down in turn.
                is_one = encoder.channels == 1
                encoder.glitch = default_glitch(encoder.slots, rated) if is_one else 0.0
        except (AttributeError, TypeError, ZeroDivisionError):
            continue


def fill_counts(robot: Robot) -> None:
    """Set the counts of a slot of each encoder, which depend on the board and on its channels.

    Without a board that could be read there is one.
    """
    board = BOARDS.get(getattr(robot.board, "type", ""))
    for side in SIDES:
        try:
            encoder = field_value(robot, f"drive.{side}.encoder")
            if board is not None and encoder.channels == 2:
                encoder.counts_of_slot = board.counts_of_slot
        except AttributeError:
            continue


def fill_bridge(robot: Robot) -> None:
    """Set the data-sheet values of each motor's driver: its voltage over that of the battery,
    and what it does between two pulses.

    Values that could not be read leave 0 and False.
    """
    for side in SIDES:
        try:
            motor = field_value(robot, f"drive.{side}.motor")
            facts = MOTOR_DRIVERS.get(motor.driver)
            full = robot.battery.full or USUAL_BATTERY
        except AttributeError:
            continue
        if facts is not None:
            motor.bridge_share = facts.bridge.threshold_share(full)
            motor.is_shorted = facts.bridge.off_state == "shorted"


def fill_curves(robot: Robot) -> None:
    """Set the curve of each Sharp sensor that does not state one, as its data sheet has it."""
    for sensor in (robot.sensors or {}).values():
        facts = SHARPS.get(getattr(sensor, "type", ""))
        curve = getattr(sensor, "curve", None)
        if facts is None or curve is None:
            continue
        sensor.curve = copy(curve)  # a curve that is not stated is one object for all sensors
        for name, value in zip("abc", facts.curve, strict=True):
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
