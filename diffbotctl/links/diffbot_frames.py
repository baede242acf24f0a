"""Frames of the protocol `diffbot`. Made from firmware/protocol.yaml by firmware/generate.py; change those."""

# fmt: off
# ruff: noqa: E501
from __future__ import annotations

from typing import NamedTuple

VERSION = 1
CHECK_POLYNOMIAL = 0x5D6DCB
CHECK_START = 0xFEDCBA
TICK_NANOSECONDS = 64000  # one unit of the board's time in frames and of edge ages
SPEED_ONE = 256  # a speed of 1 rad/s in frames
DUTY_ONE = 32767  # full duty in a `duty` frame
GAIN_ONE = 32768  # full duty in the gains: duty, duty per rad/s
INTEGRAL_ONE = 83886  # a gain of 1 duty per rad: 65536 * 32768 / 256 a second / 100 periods
GAIN_MAXIMUM = 24576  # of every gain; 0.75 duty, or duty per rad/s, and 0.29 duty per rad
COMMAND_AGE_NANOSECONDS = 128000  # one unit of a command's age
AGE_NONE = 65535  # the age of an edge that was never seen or is too old to tell
COMMAND_AGE_NONE = 4095  # the age of a command that is too old to tell
ANALOG_ONE = 4092  # a pin at the reference voltage (sixteen readings of 1023, by four)
ANALOG_NONE = 4095  # no such sensor
PIN_NONE = 255  # not connected
DEADMAN_MINIMUM = 100  # ms
DEADMAN_MAXIMUM = 500  # ms
TELEMETRY_MAXIMUM = 100  # Hz
GLITCH_MAXIMUM = 50000  # us; at 20 slots and 100 rpm one slot lasts 15 ms
SLOTS_MAXIMUM = 10000  # counts a turn; ten times what a hobby encoder gives
FLAG_STORED = 16  # settings are in the EEPROM
FLAG_BUTTON = 32  # the stop button is pressed
FLAG_LEFT_FAULT = 64  # the left motor had power and its encoder gave no edges
FLAG_RIGHT_FAULT = 128  # the same on the right
CAPTURE_EDGES = 8  # edges in one capture frame
CAPTURE_TIME = 16383  # mask of the time in an entry
MODE = {0: 'unset', 1: 'stopped', 2: 'speed', 3: 'duty', 4: 'expired', 5: 'fault', 6: 'overruled', 7: 'button'}
MODE_MEANING = {'unset': 'no valid settings, nothing moves', 'stopped': 'stopped by its owner', 'speed': 'the wheel-speed loop runs', 'duty': 'raw duty', 'expired': 'the dead-man stopped it: no valid command in time', 'fault': 'a motor had power and its encoder gave no edges', 'overruled': 'another link stopped it', 'button': 'the stop button is pressed'}
RESET = {0: 'unknown', 1: 'power', 2: 'line', 3: 'brownout', 4: 'watchdog'}
RESET_MEANING = {'unknown': 'not told by the chip or the bootloader', 'power': 'power came on', 'line': 'the reset line', 'brownout': 'the supply dipped', 'watchdog': 'the program hung'}
REFUSAL = {0: 'none', 1: 'moving', 2: 'pin_missing', 3: 'pin_link', 4: 'pin_pwm', 5: 'pin_interrupt', 6: 'pin_analog', 7: 'pin_twice', 8: 'range', 9: 'owned'}
REFUSAL_MEANING = {'none': 'taken', 'moving': 'settings are taken at rest only', 'pin_missing': 'the board has no such pin', 'pin_link': 'the pin carries a serial link', 'pin_pwm': 'the pin has no PWM', 'pin_interrupt': 'the pin cannot raise an interrupt', 'pin_analog': 'the pin is no analog input', 'pin_twice': 'the pin is used twice', 'range': 'the value is out of range', 'owned': 'another link owns the commands'}
ITEM = {0: 'uptime', 1: 'flags', 2: 'battery', 3: 'free_stack', 4: 'loop', 5: 'left_rejected', 6: 'right_rejected', 7: 'damaged', 8: 'foreign', 9: 'dropped'}
ITEM_MEANING = {'uptime': 'minutes since the start', 'flags': 'reset cause, and the bits FLAG_...', 'battery': 'analog reading', 'free_stack': 'bytes never used', 'loop': 'longest pass of the main loop since told last, us', 'left_rejected': 'edges refused by the glitch filter', 'right_rejected': 'edges refused by the glitch filter', 'damaged': 'frames refused', 'foreign': 'commands of a link that did not own them', 'dropped': 'frames that found no room'}
ACTION = {0: 'light', 1: 'clear', 2: 'capture'}
ACTION_MEANING = {'light': 'LED: 0 off, 1 on, 2 toggle', 'clear': 'forget a wheel fault', 'capture': 'raw edges: 0 off, 1 on'}
BOARD = {0: 'unknown', 1: 'mega2560'}
BOARD_MEANING = {'unknown': '', 'mega2560': 'Arduino Mega 2560'}
EDGE = {1: 'both', 2: 'falling', 3: 'rising'}
EDGE_MEANING = {'both': '', 'falling': '', 'rising': ''}
BAUD = {0: 'b9600', 1: 'b19200', 2: 'b38400', 3: 'b57600', 4: 'b115200'}
BAUD_MEANING = {'b9600': '9600', 'b19200': '19200', 'b38400': '38400', 'b57600': '57600', 'b115200': '115200'}


class CommandFrame(NamedTuple):
    """wheel speeds; 10 bytes on the wire"""

    sequence: int  # number of this command
    left: int  # 1/256 rad/s
    right: int  # 1/256 rad/s

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            1
            | (self.sequence & 15) << 4
            | (self.left & 65535) << 8
            | (self.right & 65535) << 24
        ).to_bytes(5, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> CommandFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 5:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
            (((bits >> 8 & 65535) ^ 32768) - 32768),
            (((bits >> 24 & 65535) ^ 32768) - 32768),
        )


class DutyFrame(NamedTuple):
    """raw duty for identification"""

    sequence: int  # number of this command
    left: int  # 1/32767
    right: int  # 1/32767

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            2
            | (self.sequence & 15) << 4
            | (self.left & 65535) << 8
            | (self.right & 65535) << 24
        ).to_bytes(5, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> DutyFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 5:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
            (((bits >> 8 & 65535) ^ 32768) - 32768),
            (((bits >> 24 & 65535) ^ 32768) - 32768),
        )


class StopFrame(NamedTuple):
    """motors off; also claims the commands when nobody owns them; 6 bytes on the wire"""

    sequence: int  # number of this command

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            3
            | (self.sequence & 15) << 4
        ).to_bytes(1, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> StopFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 1:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
        )


class AskFrame(NamedTuple):
    """asks for hello, and for telemetry from now on"""

    version: int  # the host's protocol version

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            4
            | (self.version & 15) << 4
        ).to_bytes(1, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> AskFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 1:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
        )


class ActionFrame(NamedTuple):
    """a small deed"""

    action: int  # code
    value: int  # its argument

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            5
            | (self.action & 15) << 4
            | (self.value & 255) << 8
        ).to_bytes(2, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> ActionFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 2:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
            (bits >> 8 & 255),
        )


class SettingsFrame(NamedTuple):
    """everything the firmware must know of the robot; also the content of an EEPROM slot"""

    edge: int  # which edges count
    edge_times: int  # state frames rather than counts frames
    brake: int  # brake at rest rather than coast
    left_reversed: int  # the motor's wires are swapped
    right_reversed: int  # the motor's wires are swapped
    left_encoder_reversed: int  # quadrature counts the other way
    right_encoder_reversed: int  # quadrature counts the other way
    enable_inverted: int  # the driver is enabled by a low level
    button_high: int  # pressed is high (a normally closed contact to ground)
    reserved: int  # zero
    baud: int  # of UART1
    left_enable: int  # pin with PWM
    left_in1: int  # pin
    left_in2: int  # pin
    left_encoder: int  # pin with an interrupt
    left_encoder_b: int  # pin of the second channel, or none
    right_enable: int  # pin with PWM
    right_in1: int  # pin
    right_in2: int  # pin
    right_encoder: int  # pin with an interrupt
    right_encoder_b: int  # pin of the second channel, or none
    button: int  # pin of the stop button, or none
    range: int  # analog channel (A0 is 0), or none
    battery: int  # analog channel, or none
    telemetry: int  # Hz
    slots: int  # counts in a turn of the wheel
    glitch: int  # us a level must last before the edge that ends it counts
    deadman: int  # ms
    left_start: int  # duty that just moves the wheel, 1/32768
    left_gain: int  # duty per rad/s, 1/32768
    right_start: int  # duty that just moves the wheel, 1/32768
    right_gain: int  # duty per rad/s, 1/32768
    proportional: int  # duty per rad/s of error, 1/32768
    integral: int  # duty per rad of error, 1/INTEGRAL_ONE

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            6
            | (self.edge & 3) << 4
            | (self.edge_times & 1) << 6
            | (self.brake & 1) << 7
            | (self.left_reversed & 1) << 8
            | (self.right_reversed & 1) << 9
            | (self.left_encoder_reversed & 1) << 10
            | (self.right_encoder_reversed & 1) << 11
            | (self.enable_inverted & 1) << 12
            | (self.button_high & 1) << 13
            | (self.reserved & 3) << 14
            | (self.baud & 255) << 16
            | (self.left_enable & 255) << 24
            | (self.left_in1 & 255) << 32
            | (self.left_in2 & 255) << 40
            | (self.left_encoder & 255) << 48
            | (self.left_encoder_b & 255) << 56
            | (self.right_enable & 255) << 64
            | (self.right_in1 & 255) << 72
            | (self.right_in2 & 255) << 80
            | (self.right_encoder & 255) << 88
            | (self.right_encoder_b & 255) << 96
            | (self.button & 255) << 104
            | (self.range & 255) << 112
            | (self.battery & 255) << 120
            | (self.telemetry & 65535) << 128
            | (self.slots & 65535) << 144
            | (self.glitch & 65535) << 160
            | (self.deadman & 65535) << 176
            | (self.left_start & 65535) << 192
            | (self.left_gain & 65535) << 208
            | (self.right_start & 65535) << 224
            | (self.right_gain & 65535) << 240
            | (self.proportional & 65535) << 256
            | (self.integral & 65535) << 272
        ).to_bytes(36, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> SettingsFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 36:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 3),
            (bits >> 6 & 1),
            (bits >> 7 & 1),
            (bits >> 8 & 1),
            (bits >> 9 & 1),
            (bits >> 10 & 1),
            (bits >> 11 & 1),
            (bits >> 12 & 1),
            (bits >> 13 & 1),
            (bits >> 14 & 3),
            (bits >> 16 & 255),
            (bits >> 24 & 255),
            (bits >> 32 & 255),
            (bits >> 40 & 255),
            (bits >> 48 & 255),
            (bits >> 56 & 255),
            (bits >> 64 & 255),
            (bits >> 72 & 255),
            (bits >> 80 & 255),
            (bits >> 88 & 255),
            (bits >> 96 & 255),
            (bits >> 104 & 255),
            (bits >> 112 & 255),
            (bits >> 120 & 255),
            (bits >> 128 & 65535),
            (bits >> 144 & 65535),
            (bits >> 160 & 65535),
            (bits >> 176 & 65535),
            (bits >> 192 & 65535),
            (bits >> 208 & 65535),
            (bits >> 224 & 65535),
            (bits >> 240 & 65535),
            (bits >> 256 & 65535),
            (bits >> 272 & 65535),
        )


class StateFrame(NamedTuple):
    """both wheels at one moment, with the ages of their last edges"""

    boot: int  # changes at each restart
    sequence: int  # counts frames of this kind
    dropped: int  # a frame found no room since the last one
    reserved: int  # zero
    mode: int  # code
    command_age: int  # 128 us
    time: int  # 64 us, low bits
    left: int  # low bits of the count
    right: int  # low bits of the count
    range: int  # the analog sensor, mean of 16 readings
    command: int  # number of the command in force
    left_age: int  # 64 us
    right_age: int  # 64 us

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            8
            | (self.boot & 15) << 4
            | (self.sequence & 63) << 8
            | (self.dropped & 1) << 14
            | (self.reserved & 1) << 15
            | (self.mode & 15) << 16
            | (self.command_age & 4095) << 20
            | (self.time & 65535) << 32
            | (self.left & 65535) << 48
            | (self.right & 65535) << 64
            | (self.range & 4095) << 80
            | (self.command & 15) << 92
            | (self.left_age & 65535) << 96
            | (self.right_age & 65535) << 112
        ).to_bytes(16, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> StateFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 16:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
            (bits >> 8 & 63),
            (bits >> 14 & 1),
            (bits >> 15 & 1),
            (bits >> 16 & 15),
            (bits >> 20 & 4095),
            (bits >> 32 & 65535),
            (bits >> 48 & 65535),
            (bits >> 64 & 65535),
            (bits >> 80 & 4095),
            (bits >> 92 & 15),
            (bits >> 96 & 65535),
            (bits >> 112 & 65535),
        )


class CountsFrame(NamedTuple):
    """the beginning of a state frame without the ages, for 50 Hz"""

    boot: int  # changes at each restart
    sequence: int  # counts frames of this kind
    dropped: int  # a frame found no room since the last one
    reserved: int  # zero
    mode: int  # code
    command_age: int  # 128 us
    time: int  # 64 us, low bits
    left: int  # low bits of the count
    right: int  # low bits of the count
    range: int  # the analog sensor, mean of 16 readings
    command: int  # number of the command in force

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            9
            | (self.boot & 15) << 4
            | (self.sequence & 63) << 8
            | (self.dropped & 1) << 14
            | (self.reserved & 1) << 15
            | (self.mode & 15) << 16
            | (self.command_age & 4095) << 20
            | (self.time & 65535) << 32
            | (self.left & 65535) << 48
            | (self.right & 65535) << 64
            | (self.range & 4095) << 80
            | (self.command & 15) << 92
        ).to_bytes(12, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> CountsFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 12:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
            (bits >> 8 & 63),
            (bits >> 14 & 1),
            (bits >> 15 & 1),
            (bits >> 16 & 15),
            (bits >> 20 & 4095),
            (bits >> 32 & 65535),
            (bits >> 48 & 65535),
            (bits >> 64 & 65535),
            (bits >> 80 & 4095),
            (bits >> 92 & 15),
        )


class StatusFrame(NamedTuple):
    """one of the things that change slowly, in turn, so that no state frame waits long for it"""

    item: int  # code
    value: int  # its value

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            10
            | (self.item & 15) << 4
            | (self.value & 65535) << 8
        ).to_bytes(3, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> StatusFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 3:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
            (bits >> 8 & 65535),
        )


class HelloFrame(NamedTuple):
    """who this is"""

    boot: int  # changes at each restart
    version: int  # of the protocol
    major: int  # of the firmware
    minor: int  # of the firmware
    patch: int  # of the firmware
    board: int  # code
    reset: int  # code
    mode: int  # code
    uart: int  # which UART this came from
    settings: int  # checksum of the settings in use, 0 without

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            11
            | (self.boot & 15) << 4
            | (self.version & 255) << 8
            | (self.major & 255) << 16
            | (self.minor & 255) << 24
            | (self.patch & 255) << 32
            | (self.board & 255) << 40
            | (self.reset & 15) << 48
            | (self.mode & 15) << 52
            | (self.uart & 255) << 56
            | (self.settings & 4294967295) << 64
        ).to_bytes(12, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> HelloFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 12:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
            (bits >> 8 & 255),
            (bits >> 16 & 255),
            (bits >> 24 & 255),
            (bits >> 32 & 255),
            (bits >> 40 & 255),
            (bits >> 48 & 15),
            (bits >> 52 & 15),
            (bits >> 56 & 255),
            (bits >> 64 & 4294967295),
        )


class AnswerFrame(NamedTuple):
    """what became of the settings sent"""

    refusal: int  # code
    field: int  # number of the field that was refused, in the order of the settings frame
    settings: int  # checksum of the settings now in use, 0 without

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            12
            | (self.refusal & 15) << 4
            | (self.field & 255) << 8
            | (self.settings & 4294967295) << 16
        ).to_bytes(6, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> AnswerFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 6:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
            (bits >> 8 & 255),
            (bits >> 16 & 4294967295),
        )


class CaptureFrame(NamedTuple):
    """raw edges, both flanks, unfiltered"""

    used: int  # entries in use
    sequence: int  # counts frames of this kind
    lost: int  # edges found no room
    reserved: int  # zero
    time: int  # 64 us, low 20 bits, of this frame; no edge in it is a second old
    edges: tuple[int, ...]  # 1 bit wheel (0 left), 1 bit level, low 14 bits of its time in 64 us

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            13
            | (self.used & 15) << 4
            | (self.sequence & 63) << 8
            | (self.lost & 1) << 14
            | (self.reserved & 1) << 15
            | (self.time & 4294967295) << 16
            | (self.edges[0] & 65535) << 48
            | (self.edges[1] & 65535) << 64
            | (self.edges[2] & 65535) << 80
            | (self.edges[3] & 65535) << 96
            | (self.edges[4] & 65535) << 112
            | (self.edges[5] & 65535) << 128
            | (self.edges[6] & 65535) << 144
            | (self.edges[7] & 65535) << 160
        ).to_bytes(22, 'little')

    @classmethod
    def unpack(cls, payload: bytes) -> CaptureFrame | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 22:
            return None
        bits = int.from_bytes(payload, 'little')
        return cls(
            (bits >> 4 & 15),
            (bits >> 8 & 63),
            (bits >> 14 & 1),
            (bits >> 15 & 1),
            (bits >> 16 & 4294967295),
            ((bits >> 48 & 65535), (bits >> 64 & 65535), (bits >> 80 & 65535), (bits >> 96 & 65535), (bits >> 112 & 65535), (bits >> 128 & 65535), (bits >> 144 & 65535), (bits >> 160 & 65535)),
        )


Frame = CommandFrame | DutyFrame | StopFrame | AskFrame | ActionFrame | SettingsFrame | StateFrame | CountsFrame | StatusFrame | HelloFrame | AnswerFrame | CaptureFrame
OF_TYPE: dict[int, type[Frame]] = {1: CommandFrame, 2: DutyFrame, 3: StopFrame, 4: AskFrame, 5: ActionFrame, 6: SettingsFrame, 8: StateFrame, 9: CountsFrame, 10: StatusFrame, 11: HelloFrame, 12: AnswerFrame, 13: CaptureFrame}
WIRE: dict[type[Frame], int] = {CommandFrame: 10, DutyFrame: 10, StopFrame: 6, AskFrame: 6, ActionFrame: 7, SettingsFrame: 41, StateFrame: 21, CountsFrame: 17, StatusFrame: 8, HelloFrame: 17, AnswerFrame: 11, CaptureFrame: 27}  # bytes on the wire
