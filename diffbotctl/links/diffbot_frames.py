"""Frames of the protocol `diffbot`. Generated from firmware/protocol.yaml by firmware/generate.py: change those."""

# ruff: noqa: E501
from enum import IntEnum
from typing import Annotated, NamedTuple, Self

VERSION = 3
CHECK_POLYNOMIAL = 0x5D6DCB
CHECK_START = 0xFEDCBA
CHECK_BYTES = 3
TYPE_BITS = 4
TICK_NANOSECONDS = 64000  # unit of board time in frames and of edge ages
SPEED_ONE = 256  # 1 rad/s in frames
DUTY_ONE = 32767  # full duty in a `duty` frame
REPORTED_DUTY_ONE = 127  # full duty in state, counts and inertial frames
GAIN_ONE = 32768  # full duty in the gains: duty, duty per rad/s
INTEGRAL_ONE = 5243  # a gain of 1 duty per rad: 16 * 32768 / 100 periods a second
GAIN_MAXIMUM = 24576  # of every gain: 0.75 duty, or duty per rad/s; 4.69 duty per rad
COMMAND_AGE_NANOSECONDS = 128000  # unit of a command's age
AGE_NONE = 65535  # no edge yet, or its age does not fit
COMMAND_AGE_NONE = 4095  # the age of the command does not fit
ANALOG_ONE = 4092  # reading at the reference voltage: 16 conversions of 1023, divided by 4
ANALOG_NONE = 4095  # no such sensor, or not measured yet
PIN_NONE = 255  # not connected
DEADMAN_MINIMUM = 100  # ms
DEADMAN_MAXIMUM = 500  # ms
TELEMETRY_MAXIMUM = 100  # Hz
GLITCH_MAXIMUM = 50000  # us; at 20 slots and 100 rpm one slot lasts 15 ms
GLITCH_MINIMUM = 50  # us; a shorter time means no filter, since an interrupt takes 15
SLOTS_MAXIMUM = 65535  # counts per turn
FLAG_STORED = 16  # the settings are stored in the EEPROM
FLAG_BUTTON = 32  # the stop button is pressed
FLAG_LEFT_STALL = 64  # the left motor was driven and its encoder gave no edges
FLAG_RIGHT_STALL = 128  # the same on the right
FLAG_LEFT_STORM = 256  # the pin of the left encoder changes faster than a wheel can turn
FLAG_RIGHT_STORM = 512  # the same on the right
FLAG_BATTERY = 1024  # the battery is below battery_low
FLAG_GYRO_SILENT = 2048  # the gyro does not answer at its address
FLAG_GYRO_BUS = 4096  # the I2C bus is held low, or has no pull-ups
FLAG_GYRO_STUCK = 8192  # the rate of the gyro does not change
FLAG_GYRO_RANGE = 16384  # the robot turns faster than the gyro measures
FLAG_GYRO_GRAVITY = 32768  # the axis of the gyro does not point as the settings state
RECEIVE_MOST = 96  # bytes of the longest payload that a board of this version takes
RANGE_MASK = 16383  # bits of a range value
RANGE_NOTHING = 16383  # no echo: nothing in range
RANGE_SILENT = 16382  # the sensor does not answer its trigger
RANGE_ENDLESS = 16381  # the echo does not end
ECHO_NANOSECONDS = 4000  # unit of the length of an echo
RANGE_AGE_NANOSECONDS = 4000000  # unit of the age of a range
RANGE_TURN_NANOSECONDS = 51000000  # time from one of the further sensors to the next
RANGE_SENSORS = 4  # sensors of range frames
TURN_NANODEGREES = 9770992  # unit of the turn: 64 readings of 1/65.5 deg/s, each for 10 ms
TURN_LSM6_NANODEGREES = 11200000  # the same of an LSM6: 64 readings of 0.0175 deg/s
GYRO_LSM6 = 3  # in gyro_axis: its axis x of an LSM6DS3 or LSM6DSO
GYRO_MAXIMUM = 500  # deg/s, at which the gyro saturates
CAPTURE_EDGES = 8  # edges in one capture frame
CAPTURE_TIME = 16383  # mask of the time in an edge

# Types of fields: bits on the wire, negative when signed; then the number of values.
Int16 = Annotated[int, -16]
Int8 = Annotated[int, -8]
Uint1 = Annotated[int, 1]
Uint2 = Annotated[int, 2]
Uint4 = Annotated[int, 4]
Uint6 = Annotated[int, 6]
Uint8 = Annotated[int, 8]
Uint12 = Annotated[int, 12]
Uint14 = Annotated[int, 14]
Uint16 = Annotated[int, 16]
Uint16x8 = Annotated[tuple[int, ...], 16, 8]
Uint32 = Annotated[int, 32]


class ProtocolCode(IntEnum):
    """A code of the protocol, with its meaning for a person."""

    meaning: str

    def __new__(cls, value: int, meaning: str = "") -> Self:
        """A member from its declaration."""
        code = int.__new__(cls, value)
        code._value_ = value
        code.meaning = meaning
        return code

    @classmethod
    def find(cls, value: int) -> Self | None:
        """The code with this number; None when this version does not know it."""
        return next((code for code in cls if code == value), None)


class ModeCode(ProtocolCode):
    """Codes of `mode`."""

    UNSET = 0, "no valid settings, no motion"
    STOPPED = 1, "stopped by the link that owns the commands"
    SPEED = 2, "the wheel-speed loop runs"
    DUTY = 3, "raw duty"
    EXPIRED = 4, "stopped by the dead-man timeout: no valid command in time"
    FAULT = 5, "a wheel fault, of which the bits FLAG_... tell more"
    OVERRULED = 6, "another link stopped it"
    BUTTON = 7, "the stop button is pressed"
    BATTERY = 8, "stopped for a low battery"


class ResetCode(ProtocolCode):
    """Codes of `reset`."""

    UNKNOWN = 0, "not reported by the chip or the bootloader"
    POWER = 1, "power-on"
    LINE = 2, "the reset line"
    BROWNOUT = 3, "the supply voltage dipped"
    WATCHDOG = 4, "the program hung"


class RefusalCode(ProtocolCode):
    """Codes of `refusal`."""

    NONE = 0, "accepted"
    MOVING = 1, "settings are accepted at standstill only"
    PIN_MISSING = 2, "the board has no such pin"
    PIN_LINK = 3, "the pin carries a serial link"
    PIN_PWM = 4, "the pin has no PWM"
    PIN_INTERRUPT = 5, "the pin cannot raise an interrupt"
    PIN_ANALOG = 6, "the pin is not an analog input"
    PIN_TWICE = 7, "the pin is used twice"
    RANGE = 8, "the value is out of range"
    OWNED = 9, "another link owns the commands"
    UNKNOWN = 10, "the firmware does not know this value"


class ItemCode(ProtocolCode):
    """Codes of `item`."""

    UPTIME = 0, "minutes since the start"
    FLAGS = 1, "reset cause, and the bits FLAG_..."
    BATTERY = 2, "analog reading"
    FREE_STACK = 3, "bytes never used"
    LOOP = 4, "longest pass of the main loop since the last report, us"
    LEFT_REJECTED = 5, "edges rejected by the glitch filter"
    RIGHT_REJECTED = 6, "edges rejected by the glitch filter"
    DAMAGED = 7, "frames discarded"
    FOREIGN = 8, "commands of a link that does not own them"
    DROPPED = 9, "frames not sent for lack of room"


class ActionCode(ProtocolCode):
    """Codes of `action`."""

    LIGHT = 0, "LED: 0 off, 1 on, 2 toggle"
    CLEAR = 1, "clear a wheel fault, or the stop for a low battery"
    CAPTURE = 2, "raw edges: 0 off, 1 on"


class BoardCode(ProtocolCode):
    """Codes of `board`."""

    UNKNOWN = 0
    MEGA2560 = 1, "Arduino Mega 2560"
    ATMEGA328P = 2, "Arduino Uno or Nano"
    RP2040 = 3, "Raspberry Pi Pico"
    ESP32 = 4, "ESP32"


class CapabilityCode(ProtocolCode):
    """Codes of `capability`."""

    EDGE_TIMES = 0, "state frames with edge ages"
    CAPTURE = 1, "raw edges"
    STORMS = 2, "detects encoder pins that change too fast"
    BATTERY_STOP = 3, "stops for a low battery"
    QUADRATURE = 4, "encoders with two channels"
    EVERY_EDGE = 5, "counts all four edges of two channels"
    ENABLE_IN1_IN2 = 8, "motor driver with an enable input and two direction inputs, as an L298N"
    ENABLE_DIRECTION = 9, "with a PWM input and one direction input, as a DRV8838"
    TWO_PWM = 10, "with two PWM inputs, as a DRV8833"
    STANDBY = 11, "standby input of the motor driver, as a TB6612 has"
    PULSED_INPUTS = 12, "pulses on in1 and in2 that short the motor between them"
    ANALOG_RANGE = 16, "distance sensor with a voltage, as a Sharp"
    ECHO_RANGE = 17, "distance sensor with an echo, as an HC-SR04"
    SEVERAL_RANGES = 18, "up to four sensors in range frames, besides that of the state frame"
    MPU6050 = 24, "gyro of an MPU6050, MPU6500 or MPU9250"
    LSM6 = 25, "gyro of an LSM6DS3 or LSM6DSO"
    GRAVITY = 26, "the direction of its axis, by its accelerometer"


class UpwardCode(ProtocolCode):
    """Codes of `upward`."""

    UNCHECKED = 0, "the axis of the gyro may point anywhere"
    UP = 1
    DOWN = 2


class DriverCode(ProtocolCode):
    """Codes of `driver`."""

    ENABLE_IN1_IN2 = 0, "enable with PWM, in1, in2"
    ENABLE_DIRECTION = 1, "enable with PWM; in1 is the direction, in2 none"
    TWO_PWM = 2, "in1 and in2 with PWM, enable none"
    PULSED_INPUTS = 3, "in1 and in2 with PWM, both high between the pulses; enable high or none"


class EdgeCode(ProtocolCode):
    """Codes of `edge`."""

    BOTH = 1
    FALLING = 2
    RISING = 3


class BaudCode(ProtocolCode):
    """Codes of `baud`."""

    B9600 = 0, "9600"
    B19200 = 1, "19200"
    B38400 = 2, "38400"
    B57600 = 3, "57600"
    B115200 = 4, "115200"


class CommandFrame(NamedTuple):
    """Wheel speeds; 10 bytes on the wire."""

    sequence: Uint4  # sequence number of this command
    left: Int16  # 1/256 rad/s
    right: Int16  # 1/256 rad/s


class DutyFrame(NamedTuple):
    """Raw duty for identification."""

    sequence: Uint4  # sequence number of this command
    left: Int16  # 1/32767
    right: Int16  # 1/32767


class StopFrame(NamedTuple):
    """Motors off; also claims the commands when no link owns them; 6 bytes on the wire."""

    sequence: Uint4  # sequence number of this command


class AskFrame(NamedTuple):
    """Requests a hello, and telemetry from now on."""

    version: Uint4  # the host's protocol version


class ActionFrame(NamedTuple):
    """One action of the board."""

    action: Uint4  # code
    value: Uint8  # its argument


class SettingsFrame(NamedTuple):
    """All settings of the robot; also the content of an EEPROM slot."""

    edge: Uint2  # which edges count
    edge_times: Uint1  # state frames rather than counts frames
    brake: Uint1  # brake at rest rather than coast
    left_reversed: Uint1  # in1 high turns the wheel backwards
    right_reversed: Uint1  # in1 high turns the wheel backwards
    left_encoder_reversed: Uint1  # quadrature counts down going forward
    right_encoder_reversed: Uint1  # quadrature counts down going forward
    enable_inverted: Uint1  # the driver is enabled by a low level
    button_high: Uint1  # pressed is high (a normally closed contact to ground)
    every_edge: Uint1  # two channels: all four edges of a slot count, not one
    reserved: Uint1  # zero
    baud: Uint8  # of UART1
    driver: Uint8  # code
    left_enable: Uint8  # pin with PWM
    left_in1: Uint8  # pin
    left_in2: Uint8  # pin
    left_encoder: Uint8  # pin with an interrupt
    left_encoder_b: Uint8  # pin of the second channel, or none
    right_enable: Uint8  # pin with PWM
    right_in1: Uint8  # pin
    right_in2: Uint8  # pin
    right_encoder: Uint8  # pin with an interrupt
    right_encoder_b: Uint8  # pin of the second channel, or none
    button: Uint8  # pin of the stop button, or none
    range: Uint8  # analog channel (A0 is 0), or none
    battery: Uint8  # analog channel, or none
    telemetry: Uint16  # Hz
    left_slots: Uint16  # counts per turn of the wheel
    right_slots: Uint16  # counts per turn of the wheel
    glitch: Uint16  # us that a level must last for the edge at its end to count
    deadman: Uint16  # ms
    battery_low: Uint16  # analog reading below which the battery is low; 0: never
    left_start: Uint16  # duty that just moves the wheel, 1/32768
    left_gain: Uint16  # duty per rad/s, 1/32768
    left_proportional: Uint16  # duty per rad/s of error, 1/32768
    left_integral: Uint16  # duty per rad of error, 1/INTEGRAL_ONE
    right_start: Uint16  # duty that just moves the wheel, 1/32768
    right_gain: Uint16  # duty per rad/s, 1/32768
    right_proportional: Uint16  # duty per rad/s of error, 1/32768
    right_integral: Uint16  # duty per rad of error, 1/INTEGRAL_ONE
    standby: Uint8  # pin of the standby input, counted from 1; 0: none
    trigger_1: Uint8  # pin, counted from 1, of sensor 1 in range frames; 0: analog
    input_1: Uint8  # its echo pin or analog channel, counted from 1; 0: no sensor
    trigger_2: Uint8  # pin, counted from 1, of sensor 2 in range frames; 0: analog
    input_2: Uint8  # its echo pin or analog channel, counted from 1; 0: no sensor
    trigger_3: Uint8  # pin, counted from 1, of sensor 3 in range frames; 0: analog
    input_3: Uint8  # its echo pin or analog channel, counted from 1; 0: no sensor
    trigger_4: Uint8  # pin, counted from 1, of sensor 4 in range frames; 0: analog
    input_4: Uint8  # its echo pin or analog channel, counted from 1; 0: no sensor
    gyro_address: Uint8  # I2C address of the gyro; 0: none
    gyro_axis: Uint8  # its axis that is read: 0 x, 1 y, 2 z; those of an LSM6 from GYRO_LSM6 on
    lag: Uint8  # of the slower motor, 10 ms; 0: unknown
    gyro_upward: Uint8  # where the axis of the gyro points: code


class StateFrame(NamedTuple):
    """Both wheels at one time, with the ages of their last edges."""

    boot: Uint4  # changes at each restart
    sequence: Uint6  # sequence number of frames of this type
    dropped: Uint1  # a frame was dropped since the last one
    level: Uint1  # of a pin: of the left encoder in frames of even sequence, else of the right one
    mode: Uint4  # code
    command_age: Uint12  # 128 us
    time: Uint16  # 64 us, low bits
    left: Uint16  # low bits of the count
    right: Uint16  # low bits of the count
    range: Uint12  # the analog sensor, mean of 16 readings
    command: Uint4  # sequence number of the command in force
    duty: Int8  # 1/127; of the left motor in frames of even sequence, else of the right
    left_age: Uint16  # 64 us
    right_age: Uint16  # 64 us


class InertialFrame(NamedTuple):
    """A state frame with the turn that a gyro has measured."""

    boot: Uint4  # changes at each restart
    sequence: Uint6  # sequence number of frames of this type
    dropped: Uint1  # a frame was dropped since the last one
    turn_fault: Uint1  # the turn is wrong or was wrong lately: bits FLAG_GYRO_...
    mode: Uint4  # code
    command_age: Uint12  # 128 us
    time: Uint16  # 64 us, low bits
    left: Uint16  # low bits of the count
    right: Uint16  # low bits of the count
    range: Uint12  # the analog sensor, mean of 16 readings
    command: Uint4  # sequence number of the command in force
    duty: Int8  # 1/127; of the left motor in frames of even sequence, else of the right
    left_age: Uint16  # 64 us
    right_age: Uint16  # 64 us
    turn: Uint16  # about the axis of the settings since the start, TURN_NANODEGREES, low bits


class CountsFrame(NamedTuple):
    """A state frame without the ages, for 48 Hz."""

    boot: Uint4  # changes at each restart
    sequence: Uint6  # sequence number of frames of this type
    dropped: Uint1  # a frame was dropped since the last one
    level: Uint1  # of a pin: of the left encoder in frames of even sequence, else of the right one
    mode: Uint4  # code
    command_age: Uint12  # 128 us
    time: Uint16  # 64 us, low bits
    left: Uint16  # low bits of the count
    right: Uint16  # low bits of the count
    range: Uint12  # the analog sensor, mean of 16 readings
    command: Uint4  # sequence number of the command in force
    duty: Int8  # 1/127; of the left motor in frames of even sequence, else of the right


class StatusFrame(NamedTuple):
    """One of the slowly changing values, in turn, so that it delays no state frame much."""

    item: Uint4  # code
    value: Uint16  # its value


class HelloFrame(NamedTuple):
    """Identity of the board and its state."""

    boot: Uint4  # changes at each restart
    version: Uint8  # of the protocol
    major: Uint8  # of the firmware
    minor: Uint8  # of the firmware
    patch: Uint8  # of the firmware
    board: Uint8  # code
    reset: Uint4  # code
    mode: Uint4  # code
    uart: Uint8  # UART that sends this frame
    settings: Uint32  # checksum of the settings in use, 0: none
    receive: Uint8  # bytes of the longest payload that the board takes
    settings_size: Uint8  # bytes of the settings frame that the board knows
    capabilities: Uint32  # bits: codes of `capability`


class AnswerFrame(NamedTuple):
    """Reply to the settings."""

    refusal: Uint4  # code
    field: Uint8  # index of the refused field in the settings frame
    settings: Uint32  # checksum of the settings now in use, 0: none


class RangeFrame(NamedTuple):
    """A measurement of one of the further distance sensors, as soon as it is done."""

    sensor: Uint2  # its index in the settings
    value: Uint14  # length of its echo in 4 us, or its analog reading plus 1; or RANGE_...
    age: Uint4  # since the trigger, 4 ms


class CaptureFrame(NamedTuple):
    """Raw edges, rising and falling, unfiltered."""

    used: Uint4  # number of edges
    sequence: Uint6  # sequence number of frames of this type
    lost: Uint1  # edges were lost
    reserved: Uint1  # zero
    time: Uint32  # of this frame, 64 us, low 20 bits; no edge in it is a second old
    edges: Uint16x8  # wheel (1 bit, 0 left), level (1 bit), low 14 bits of its time in 64 us


Frame = (
    CommandFrame
    | DutyFrame
    | StopFrame
    | AskFrame
    | ActionFrame
    | SettingsFrame
    | StateFrame
    | InertialFrame
    | CountsFrame
    | StatusFrame
    | HelloFrame
    | AnswerFrame
    | RangeFrame
    | CaptureFrame
)
OF_TYPE: dict[int, type[Frame]] = {
    1: CommandFrame,
    2: DutyFrame,
    3: StopFrame,
    4: AskFrame,
    5: ActionFrame,
    6: SettingsFrame,
    8: StateFrame,
    7: InertialFrame,
    9: CountsFrame,
    10: StatusFrame,
    11: HelloFrame,
    12: AnswerFrame,
    14: RangeFrame,
    13: CaptureFrame,
}
