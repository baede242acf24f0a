"""The robot file, declared: board, pins, wheels, encoders, sensors, link, limits, body, truth."""

from __future__ import annotations

from math import pi
from typing import Any, Literal

from diffbotctl.config.simulation import Simulation
from diffbotctl.params import Choice, Param, Pin, Section

RPM = 2 * pi / 60  # rad/s
SIDES = ("left", "right")

BoardType = Literal["mega2560", "atmega328p", "simulated"]
BoardSupply = Literal["vin", "regulator", "usb"]
Protocol = Literal["diffbot", "rosserial"]
BaudRate = Literal[9600, 19200, 38400, 57600, 115200]
Radio = Literal["hc05", "cable"]
LevelShift = Literal["divider", "direct"]
MotorDriver = Literal["l298n", "none"]
IdleMode = Literal["coast", "brake"]
CountedEdge = Literal["rising", "falling"]
Polarity = Literal["unproven", "checked_by_hand", "calibrated"]
SensorType = Literal["sharp_gp2y0a41sk0f", "lds01", "overhead_camera"]


class BoardSection(Section):
    """The microcontroller board and how it speaks."""

    type: BoardType = Choice(
        BoardType,
        default="mega2560",
        help="Kind of board: its pins decide what can be connected where. simulated: none, the "
        "robot lives in the simulator alone and its pins are `none`.",
    )
    telemetry = Param(
        float,
        unit="Hz",
        default=40.0,
        minimum=1.0,
        maximum=100.0,
        help="How often the board reports counts, edge times and sensor voltages.",
    )
    edge_times = Param(
        bool, default=True, help="Report when the last edge of each encoder came, not only counts."
    )
    deadman = Param(
        float,
        unit="s",
        default=0.3,
        minimum=0.1,
        maximum=0.5,
        help="The board stops its motors by itself when no valid command came for so long.",
        reason="shorter stops the robot between two commands, longer lets it drive blind",
    )
    stop_button = Param(
        Pin, none=True, default=None, help="Pin of an emergency stop button, or none."
    )
    supply: BoardSupply = Choice(
        BoardSupply,
        default="vin",
        help="What feeds it: the battery at VIN, the motor driver's 5 V regulator, or USB alone.",
    )


class LinkSection(Section):
    """The serial line between host and board."""

    protocol: Protocol = Choice(
        Protocol, default="diffbot", help="diffbot: our firmware. rosserial: the book's firmware."
    )
    uart = Param(
        int, default=1, minimum=0, maximum=3, help="Serial port of the board; 0 is the USB."
    )
    baud: BaudRate = Choice(
        BaudRate, default=9600, help="Baud rate of that port. A USB port always means 115200."
    )
    radio: Radio | None = Choice(
        Radio,
        none=True,
        default=None,
        help="What is on that port; left out: an HC-05, or on port 0 the USB cable.",
    )
    level: LevelShift = Choice(
        LevelShift,
        default="divider",
        help="How the board's 5 V signal reaches the module's 3.3 V input.",
    )
    command_delay = Param(
        float,
        unit="s",
        default=0.015,
        minimum=0.0,
        maximum=1.0,
        help="From the host to the motor: the wire, the radio, the board's loop.",
    )
    command_jitter = Param(
        float,
        unit="s",
        default=0.0,
        minimum=0.0,
        maximum=0.1,
        help="How much that delay scatters, sd; 0 where the board tells when a command took hold.",
    )
    stamp_jitter = Param(
        float,
        unit="s",
        default=0.0,
        minimum=0.0,
        maximum=0.1,
        help="How much the times of telemetry scatter, sd; 0 where the board stamps its frames.",
    )

    @property
    def has_radio(self) -> bool:
        """True when a Bluetooth module is on the link's port; on the USB port only if stated."""
        return self.radio == "hc05" or (self.radio is None and self.uart != 0)


class WheelSection(Section):
    """One wheel."""

    diameter = Param(float, unit="m", above=0.01, below=0.5, help="Rolling diameter of the wheel.")
    width = Param(
        float, unit="m", default=0.026, above=0.001, below=0.3, help="How wide its tyre is."
    )
    mass = Param(float, unit="kg", default=0.035, above=0.0, help="What it weighs.")


class SpeedLoopSection(Section):
    """Feed-forward and PI of one wheel's speed, run on the board, or on the host for PWM boards."""

    static = Param(
        float,
        unit="1",
        default=0.10,
        minimum=0.0,
        maximum=0.75,
        help="Duty that just overcomes friction.",
    )
    speed = Param(
        float,
        none=True,
        default=None,
        above=0.0,
        maximum=0.75,
        help="Duty per rad/s above the static part; none: the rest of the duty at rated speed.",
    )
    proportional = Param(
        float, default=0.0, minimum=0.0, maximum=0.75, help="Duty per rad/s of speed error."
    )
    integral = Param(
        float, default=0.02, minimum=0.0, maximum=0.29, help="Duty per rad of angle error."
    )


class MotorSection(Section):
    """One motor and its half of the driver chip."""

    driver: MotorDriver = Choice(
        MotorDriver,
        default="l298n",
        help="Motor driver chip; none: of a robot that is simulated only.",
    )
    rated = Param(
        float,
        unit="rad/s",
        above=0.0,
        default=100 * RPM,
        help="Speed of the wheel at full duty and full battery.",
    )
    idle: IdleMode = Choice(
        IdleMode,
        default="coast",
        help="What a motor at rest does: turn freely, or short its windings.",
    )
    enable = Param(Pin, none=True, help="Pin of the driver's EN input; carries the PWM.")
    in1 = Param(Pin, none=True, help="Pin of the driver's first direction input.")
    in2 = Param(Pin, none=True, help="Pin of the driver's second direction input.")
    reversed = Param(
        bool, default=False, help="True when in1 high and in2 low turns the wheel backwards."
    )
    lag = Param(
        float, unit="s", default=0.1, above=0.0, below=2.0, help="Time constant from duty to speed."
    )
    loop = Param(SpeedLoopSection, default=SpeedLoopSection(), help="The wheel's speed loop.")


class EncoderSection(Section):
    """One wheel encoder."""

    channels = Param(
        int, choices=(1,), default=1, help="Channels; one channel cannot tell the direction."
    )
    slots = Param(
        int, minimum=1, maximum=4096, help="Slots of the disc: counts per turn of the wheel."
    )
    edge: CountedEdge = Choice(CountedEdge, default="rising", help="Which flank of a slot counts.")
    glitch = Param(
        float,
        unit="s",
        default=0.002,
        minimum=0.0,
        maximum=0.05,
        help="An edge this soon after the last is noise and is not counted.",
    )
    pin = Param(Pin, none=True, help="Pin of the encoder's output; must raise interrupts.")
    slot_errors = Param(
        list[float],
        unit="1",
        default=[],
        minimum=-0.4,
        maximum=0.4,
        help="How far each slot's flank lies from its even place, in pitches, in the order of "
        "turning forward; empty: not known.",
    )
    back_errors = Param(
        list[float],
        unit="1",
        default=[],
        minimum=-0.4,
        maximum=0.4,
        help="The same of the flanks seen backward, beyond their place by open_share; empty: not "
        "known.",
    )
    open_share = Param(
        float,
        unit="1",
        none=True,
        default=None,
        minimum=0.1,
        maximum=0.9,
        help="Share of a pitch during which the pin keeps the level that a counted flank brought: "
        "how far apart the flanks seen forward and backward lie; none: not known, about half.",
    )


class SideSection(Section):
    """One side of the drive: what is written here, over what both sides share."""

    wheel = Param(WheelSection, shared=True, help="This side's wheel.")
    motor = Param(MotorSection, shared=True, help="This side's motor.")
    encoder = Param(EncoderSection, shared=True, help="This side's encoder.")


class DriveSection(Section):
    """The two driven wheels. `wheel`, `motor` and `encoder` here hold for both sides."""

    type = Param(str, choices=("differential",), default="differential", help="Kind of drive.")
    track = Param(
        float, unit="m", above=0.02, below=2.0, help="Distance between the middles of the tyres."
    )
    polarity: Polarity = Choice(
        Polarity,
        default="unproven",
        help="Who has seen that each motor turns its own wheel the right way.",
    )
    wheel: Any = Param(WheelSection, shared=True, default=None, help="What both wheels share.")
    motor: Any = Param(MotorSection, shared=True, default=None, help="What both motors share.")
    encoder: Any = Param(
        EncoderSection, shared=True, default=None, help="What both encoders share."
    )
    left = Param(SideSection, help="The left side.")
    right = Param(SideSection, help="The right side.")


class MountSection(Section):
    """Where a sensor sits, seen from the middle of the axle (base_link)."""

    x = Param(float, unit="m", default=0.0, help="Forward.")
    y = Param(float, unit="m", default=0.0, help="Left.")
    z = Param(float, unit="m", default=0.0, help="Up from the axle; for drawings and the model.")
    heading = Param(float, unit="rad", default=0.0, help="Where it looks; counter-clockwise.")


class CurveSection(Section):
    """A Sharp sensor's curve: volts = a / (distance + b) + c."""

    a = Param(float, default=0.1498, above=0.0, help="Steepness, in V m.")
    b = Param(float, unit="m", default=0.0134, minimum=0.0, help="Shift of the distance.")
    c = Param(float, unit="V", default=-0.047, help="Shift of the voltage.")


class SensorSection(Section):
    """One sensor. Laser scanner and overhead camera exist in the simulator alone."""

    type: SensorType = Choice(
        SensorType, help="Part name of the sensor. overhead_camera: sees the true pose from above."
    )
    pin = Param(
        Pin, none=True, help="Analog pin that reads its voltage; none: it is read otherwise."
    )
    at = Param(MountSection, default=MountSection(), help="Where it sits on the robot.")
    curve = Param(
        CurveSection, default=CurveSection(), help="Its curve; the data sheet's typical part."
    )


class CasterSection(Section):
    """The ball or caster that the robot rests on beside its two wheels."""

    x = Param(
        float,
        unit="m",
        none=True,
        default=None,
        help="Where it touches the ground, forward of the axle; none: near the farther end.",
    )
    diameter = Param(float, unit="m", default=0.02, above=0.0, below=0.5, help="Of its ball.")
    mass = Param(float, unit="kg", default=0.02, above=0.0, help="What it weighs.")


class BodySection(Section):
    """The robot's outline, measured from the middle of the axle."""

    front = Param(float, unit="m", minimum=0.0, default=0.08, help="How far it reaches forward.")
    back = Param(float, unit="m", minimum=0.0, default=0.15, help="How far it reaches backward.")
    width = Param(
        float, unit="m", above=0.0, default=0.151, help="Its whole width, tyres included."
    )
    height = Param(
        float,
        unit="m",
        above=0.0,
        default=0.1,
        help="How high the chassis is, from its underside to its top.",
    )
    clearance = Param(
        float, unit="m", above=0.0, default=0.02, help="Free height under the chassis."
    )
    mass = Param(
        float,
        unit="kg",
        above=0.0,
        default=0.7,
        help="What the robot weighs without wheels and caster; only the model needs it.",
    )
    caster = Param(
        CasterSection, default=CasterSection(), help="What it rests on beside its wheels."
    )


class LimitsSection(Section):
    """What the robot may do at most."""

    speed = Param(float, unit="m/s", above=0.0, default=0.3, help="Forward and backward speed.")
    turn_rate = Param(float, unit="rad/s", above=0.0, default=4.0, help="Turning speed.")
    acceleration = Param(
        float, unit="m/s2", above=0.0, default=1.0, help="Speeding up, at a wheel."
    )
    braking = Param(float, unit="m/s2", above=0.0, default=1.5, help="Slowing down, at a wheel.")


class BatterySection(Section):
    """The motor supply."""

    full = Param(
        float,
        unit="V",
        none=True,
        default=None,
        above=0.0,
        maximum=60.0,
        help="Voltage of the full battery, for the wiring checks; none: not checked.",
    )
    pin = Param(
        Pin, none=True, default=None, help="Analog pin that reads it through a divider, or none."
    )
    divider = Param(
        float,
        unit="1",
        none=True,
        default=None,
        minimum=1.0,
        maximum=20.0,
        help="Battery volts per volt at that pin; none: not known.",
    )
    low = Param(
        float,
        unit="V",
        minimum=0.0,
        default=0.0,
        help="Below this voltage the battery counts as low.",
    )


class Calibrated(Section):
    """One value that a calibration found, and how."""

    value: Any = Param(object, help="The value, written as the field itself would be.")
    sd: Any = Param(object, none=True, default=None, help="Its standard deviation.")
    date = Param(str, none=True, default=None, help="When it was found.")
    method = Param(str, none=True, default=None, help="The calibration that found it.")
    volts: Any = Param(
        object,
        none=True,
        default=None,
        help="Battery voltage during the calibration, or `not measured`.",
    )
    recording = Param(
        str, none=True, default=None, help="Hash of the recording that it was found from."
    )


class Robot(Section):
    """One robot: what is bolted, soldered and plugged where, and what it may do."""

    format = Param(int, choices=(1,), help="Version of this file's shape.")
    kind = Param(str, choices=("robot",), help="What this file describes.")
    include: Any = Param(
        object,
        none=True,
        default=None,
        help="A robot file, or a list of them, that this one changes.",
    )
    vars: Any = Param(dict, default={}, help="Values used elsewhere as $name.")
    board = Param(BoardSection, default=BoardSection(), help="The microcontroller board.")
    link = Param(LinkSection, default=LinkSection(), help="The serial line to the board.")
    drive = Param(DriveSection, help="Wheels, motors and encoders.")
    sensors = Param(dict[str, SensorSection], default={}, help="Sensors by name.")
    body = Param(BodySection, default=BodySection(), help="The outline.")
    limits = Param(LimitsSection, default=LimitsSection(), help="What it may do at most.")
    battery = Param(BatterySection, default=BatterySection(), help="The motor supply.")
    simulation = Param(Simulation, default=Simulation(), help="What the simulated robot is like.")
    calibration = Param(
        dict[str, Calibrated], default={}, help="Written by calibrate: field path to value."
    )


def field_value(robot: Robot | None, path: str) -> Any:
    """The field of a robot at dotted `path`. Raises AttributeError or KeyError for none."""
    value: Any = robot
    for step in path.split("."):
        value = value[step] if isinstance(value, dict) else getattr(value, step)
    return value
