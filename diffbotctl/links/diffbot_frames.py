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
DUTY_ONE = 16383  # full duty in a `duty` frame
GAIN_ONE = 32768  # full duty in the gains: duty, duty per rad/s, duty per rad
COMMAND_AGE_NANOSECONDS = 512000  # one unit of a command's age
AGE_NONE = 65535  # the age of an edge that was never seen or is too old to tell
COMMAND_AGE_NONE = 1023  # the age of a command that is too old to tell
ANALOG_ONE = 4092  # a pin at the reference voltage (sixteen readings of 1023, by four)
ANALOG_NONE = 4095  # no such sensor
PIN_NONE = 255  # not connected
DEADMAN_MINIMUM = 100  # ms
DEADMAN_MAXIMUM = 500  # ms
TELEMETRY_MAXIMUM = 100  # Hz
GLITCH_MAXIMUM = 50000  # us; at 20 slots and 100 rpm one slot lasts 15 ms
CAPTURE_EDGES = 8  # edges in one capture frame
CAPTURE_FILLER = 16383  # an interval too long for one entry; no edge
MODE = {0: 'unset', 1: 'stopped', 2: 'speed', 3: 'duty', 4: 'expired', 5: 'fault', 6: 'overruled', 7: 'button'}
MODE_MEANING = {'unset': 'no valid settings, nothing moves', 'stopped': 'stopped by its owner', 'speed': 'the wheel-speed loop runs', 'duty': 'raw duty', 'expired': 'the dead-man stopped it: no valid command in time', 'fault': 'a motor had power and its encoder gave no edges', 'overruled': 'another link stopped it', 'button': 'the stop button is pressed'}
RESET = {0: 'unknown', 1: 'power', 2: 'line', 3: 'brownout', 4: 'watchdog'}
RESET_MEANING = {'unknown': 'not told by the chip or the bootloader', 'power': 'power came on', 'line': 'the reset line', 'brownout': 'the supply dipped', 'watchdog': 'the program hung'}
REFUSAL = {0: 'none', 1: 'moving', 2: 'pin_missing', 3: 'pin_link', 4: 'pin_pwm', 5: 'pin_interrupt', 6: 'pin_analog', 7: 'pin_twice', 8: 'range', 9: 'owned'}
REFUSAL_MEANING = {'none': 'taken', 'moving': 'settings are taken at rest only', 'pin_missing': 'the board has no such pin', 'pin_link': 'the pin carries a serial link', 'pin_pwm': 'the pin has no PWM', 'pin_interrupt': 'the pin cannot raise an interrupt', 'pin_analog': 'the pin is no analog input', 'pin_twice': 'the pin is used twice', 'range': 'the value is out of range', 'owned': 'another link owns the commands'}
ACTION = {0: 'light', 1: 'clear', 2: 'capture'}
ACTION_MEANING = {'light': 'LED: 0 off, 1 on, 2 toggle', 'clear': 'forget a wheel fault', 'capture': 'raw edges: 0 off, 1 on'}
BOARD = {0: 'unknown', 1: 'mega2560'}
BOARD_MEANING = {'unknown': '', 'mega2560': 'Arduino Mega 2560'}
EDGE = {0: 'rising', 1: 'falling', 2: 'both'}
EDGE_MEANING = {'rising': '', 'falling': '', 'both': ''}
BAUD = {0: 'b9600', 1: 'b19200', 2: 'b38400', 3: 'b57600', 4: 'b115200'}
BAUD_MEANING = {'b9600': '9600', 'b19200': '19200', 'b38400': '38400', 'b57600': '57600', 'b115200': '115200'}


class Command(NamedTuple):
    """wheel speeds; 10 bytes on the wire"""

    sequence: int  # number of this command
    left: int  # 1/256 rad/s
    right: int  # 1/256 rad/s

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            1 << 36
            | (self.sequence & 63) << 30
            | (self.left & 32767) << 15
            | (self.right & 32767) << 0
        ).to_bytes(5, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Command | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 5:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 30 & 63),
            (((bits >> 15 & 32767) ^ 16384) - 16384),
            (((bits >> 0 & 32767) ^ 16384) - 16384),
        )


class Duty(NamedTuple):
    """raw duty for identification"""

    sequence: int  # number of this command
    left: int  # 1/16383
    right: int  # 1/16383

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            2 << 36
            | (self.sequence & 63) << 30
            | (self.left & 32767) << 15
            | (self.right & 32767) << 0
        ).to_bytes(5, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Duty | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 5:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 30 & 63),
            (((bits >> 15 & 32767) ^ 16384) - 16384),
            (((bits >> 0 & 32767) ^ 16384) - 16384),
        )


class Stop(NamedTuple):
    """motors off; also claims the commands when nobody owns them"""

    sequence: int  # number of this command
    guard: int  # always 0x2A

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            3 << 12
            | (self.sequence & 63) << 6
            | (self.guard & 63) << 0
        ).to_bytes(2, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Stop | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 2:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 6 & 63),
            (bits >> 0 & 63),
        )


class Ask(NamedTuple):
    """asks for hello, and for telemetry from now on"""

    version: int  # the host's protocol version
    guard: int  # always 0xA

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            4 << 12
            | (self.version & 255) << 4
            | (self.guard & 15) << 0
        ).to_bytes(2, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Ask | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 2:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 4 & 255),
            (bits >> 0 & 15),
        )


class Action(NamedTuple):
    """a small deed"""

    action: int  # code
    value: int  # its argument

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            5 << 12
            | (self.action & 15) << 8
            | (self.value & 255) << 0
        ).to_bytes(2, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Action | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 2:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 8 & 15),
            (bits >> 0 & 255),
        )


class Settings(NamedTuple):
    """everything the firmware must know of the robot; also the content of an EEPROM slot"""

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
    range: int  # analog channel (A0 is 0), or none
    battery: int  # analog channel, or none
    button: int  # pin of the stop button, or none
    left_reversed: int  # the motor's wires are swapped
    right_reversed: int  # the motor's wires are swapped
    enable_inverted: int  # the driver is enabled by a low level
    brake: int  # brake at rest rather than coast
    button_high: int  # pressed is high (a normally closed contact to ground)
    encoder_reversed_left: int  # quadrature counts the other way
    encoder_reversed_right: int  # quadrature counts the other way
    edge_times: int  # state frames rather than counts frames
    edge: int  # which edges count
    baud: int  # of UART1
    reserved: int  # zero
    slots: int  # counts in a turn of the wheel
    glitch: int  # us a level must last before the edge that ends it counts
    deadman: int  # ms
    telemetry: int  # Hz
    left_start: int  # duty that just moves the wheel, 1/32768
    right_start: int  # duty that just moves the wheel, 1/32768
    left_gain: int  # duty per rad/s, 1/32768
    right_gain: int  # duty per rad/s, 1/32768
    proportional: int  # duty per rad/s of error, 1/32768
    integral: int  # duty per rad of error, 1/32768

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            6 << 276
            | (self.left_enable & 255) << 268
            | (self.left_in1 & 255) << 260
            | (self.left_in2 & 255) << 252
            | (self.left_encoder & 255) << 244
            | (self.left_encoder_b & 255) << 236
            | (self.right_enable & 255) << 228
            | (self.right_in1 & 255) << 220
            | (self.right_in2 & 255) << 212
            | (self.right_encoder & 255) << 204
            | (self.right_encoder_b & 255) << 196
            | (self.range & 255) << 188
            | (self.battery & 255) << 180
            | (self.button & 255) << 172
            | (self.left_reversed & 1) << 171
            | (self.right_reversed & 1) << 170
            | (self.enable_inverted & 1) << 169
            | (self.brake & 1) << 168
            | (self.button_high & 1) << 167
            | (self.encoder_reversed_left & 1) << 166
            | (self.encoder_reversed_right & 1) << 165
            | (self.edge_times & 1) << 164
            | (self.edge & 3) << 162
            | (self.baud & 7) << 159
            | (self.reserved & 7) << 156
            | (self.slots & 65535) << 140
            | (self.glitch & 65535) << 124
            | (self.deadman & 65535) << 108
            | (self.telemetry & 255) << 100
            | (self.left_start & 65535) << 84
            | (self.right_start & 65535) << 68
            | (self.left_gain & 65535) << 52
            | (self.right_gain & 65535) << 36
            | (self.proportional & 65535) << 20
            | (self.integral & 65535) << 4
        ).to_bytes(35, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Settings | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 35:
            return None
        bits = int.from_bytes(payload, 'big')
        if bits & 15:
            return None
        return cls(
            (bits >> 268 & 255),
            (bits >> 260 & 255),
            (bits >> 252 & 255),
            (bits >> 244 & 255),
            (bits >> 236 & 255),
            (bits >> 228 & 255),
            (bits >> 220 & 255),
            (bits >> 212 & 255),
            (bits >> 204 & 255),
            (bits >> 196 & 255),
            (bits >> 188 & 255),
            (bits >> 180 & 255),
            (bits >> 172 & 255),
            (bits >> 171 & 1),
            (bits >> 170 & 1),
            (bits >> 169 & 1),
            (bits >> 168 & 1),
            (bits >> 167 & 1),
            (bits >> 166 & 1),
            (bits >> 165 & 1),
            (bits >> 164 & 1),
            (bits >> 162 & 3),
            (bits >> 159 & 7),
            (bits >> 156 & 7),
            (bits >> 140 & 65535),
            (bits >> 124 & 65535),
            (bits >> 108 & 65535),
            (bits >> 100 & 255),
            (bits >> 84 & 65535),
            (bits >> 68 & 65535),
            (bits >> 52 & 65535),
            (bits >> 36 & 65535),
            (bits >> 20 & 65535),
            (bits >> 4 & 65535),
        )


class State(NamedTuple):
    """both wheels at one moment, with the ages of their last edges"""

    sequence: int  # counts frames of this kind
    boot: int  # changes at each restart
    mode: int  # code
    dropped: int  # a frame found no room since the last one
    time: int  # 64 us, low bits
    left: int  # low bits of the count
    right: int  # low bits of the count
    range: int  # the analog sensor, mean of 16 readings
    command: int  # number of the command in force
    command_age: int  # 512 us
    left_age: int  # 64 us
    right_age: int  # 64 us
    reserved: int  # zero

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            8 << 124
            | (self.sequence & 63) << 118
            | (self.boot & 15) << 114
            | (self.mode & 7) << 111
            | (self.dropped & 1) << 110
            | (self.time & 65535) << 94
            | (self.left & 65535) << 78
            | (self.right & 65535) << 62
            | (self.range & 4095) << 50
            | (self.command & 63) << 44
            | (self.command_age & 1023) << 34
            | (self.left_age & 65535) << 18
            | (self.right_age & 65535) << 2
            | (self.reserved & 3) << 0
        ).to_bytes(16, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> State | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 16:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 118 & 63),
            (bits >> 114 & 15),
            (bits >> 111 & 7),
            (bits >> 110 & 1),
            (bits >> 94 & 65535),
            (bits >> 78 & 65535),
            (bits >> 62 & 65535),
            (bits >> 50 & 4095),
            (bits >> 44 & 63),
            (bits >> 34 & 1023),
            (bits >> 18 & 65535),
            (bits >> 2 & 65535),
            (bits >> 0 & 3),
        )


class Counts(NamedTuple):
    """the shorter state, for 50 Hz"""

    sequence: int  # counts frames of this kind
    boot: int  # changes at each restart
    mode: int  # code
    dropped: int  # a frame found no room since the last one
    time: int  # 64 us, low bits
    left: int  # low bits of the count
    right: int  # low bits of the count
    range: int  # the analog sensor, mean of 16 readings
    command: int  # number of the command in force
    command_age: int  # 512 us
    reserved: int  # zero

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            9 << 92
            | (self.sequence & 63) << 86
            | (self.boot & 15) << 82
            | (self.mode & 7) << 79
            | (self.dropped & 1) << 78
            | (self.time & 65535) << 62
            | (self.left & 65535) << 46
            | (self.right & 65535) << 30
            | (self.range & 4095) << 18
            | (self.command & 63) << 12
            | (self.command_age & 1023) << 2
            | (self.reserved & 3) << 0
        ).to_bytes(12, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Counts | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 12:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 86 & 63),
            (bits >> 82 & 15),
            (bits >> 79 & 7),
            (bits >> 78 & 1),
            (bits >> 62 & 65535),
            (bits >> 46 & 65535),
            (bits >> 30 & 65535),
            (bits >> 18 & 4095),
            (bits >> 12 & 63),
            (bits >> 2 & 1023),
            (bits >> 0 & 3),
        )


class Status(NamedTuple):
    """what changes slowly, once a second"""

    uptime: int  # s
    reset: int  # code
    stored: int  # the settings in use are in the EEPROM
    button: int  # the stop button is pressed
    left_fault: int  # power but no edges
    right_fault: int  # power but no edges
    battery: int  # analog reading
    free_stack: int  # bytes never used
    loop: int  # longest pass of the main loop since the last status, us
    left_rejected: int  # edges refused by the glitch filter
    right_rejected: int  # edges refused by the glitch filter
    damaged: int  # frames refused
    foreign: int  # commands of a link that did not own them
    dropped: int  # frames that found no room

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            10 << 140
            | (self.uptime & 16777215) << 116
            | (self.reset & 15) << 112
            | (self.stored & 1) << 111
            | (self.button & 1) << 110
            | (self.left_fault & 1) << 109
            | (self.right_fault & 1) << 108
            | (self.battery & 4095) << 96
            | (self.free_stack & 65535) << 80
            | (self.loop & 65535) << 64
            | (self.left_rejected & 65535) << 48
            | (self.right_rejected & 65535) << 32
            | (self.damaged & 65535) << 16
            | (self.foreign & 255) << 8
            | (self.dropped & 255) << 0
        ).to_bytes(18, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Status | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 18:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 116 & 16777215),
            (bits >> 112 & 15),
            (bits >> 111 & 1),
            (bits >> 110 & 1),
            (bits >> 109 & 1),
            (bits >> 108 & 1),
            (bits >> 96 & 4095),
            (bits >> 80 & 65535),
            (bits >> 64 & 65535),
            (bits >> 48 & 65535),
            (bits >> 32 & 65535),
            (bits >> 16 & 65535),
            (bits >> 8 & 255),
            (bits >> 0 & 255),
        )


class Hello(NamedTuple):
    """who this is"""

    version: int  # of the protocol
    major: int  # of the firmware
    minor: int  # of the firmware
    patch: int  # of the firmware
    board: int  # code
    boot: int  # changes at each restart
    reset: int  # code
    mode: int  # code
    uart: int  # which UART this came from
    settings: int  # checksum of the settings in use, 0 without

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            11 << 76
            | (self.version & 255) << 68
            | (self.major & 255) << 60
            | (self.minor & 255) << 52
            | (self.patch & 255) << 44
            | (self.board & 255) << 36
            | (self.boot & 15) << 32
            | (self.reset & 15) << 28
            | (self.mode & 7) << 25
            | (self.uart & 1) << 24
            | (self.settings & 16777215) << 0
        ).to_bytes(10, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Hello | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 10:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 68 & 255),
            (bits >> 60 & 255),
            (bits >> 52 & 255),
            (bits >> 44 & 255),
            (bits >> 36 & 255),
            (bits >> 32 & 15),
            (bits >> 28 & 15),
            (bits >> 25 & 7),
            (bits >> 24 & 1),
            (bits >> 0 & 16777215),
        )


class Answer(NamedTuple):
    """what became of the settings sent"""

    refusal: int  # code
    field: int  # number of the field that was refused, in the order of the settings frame
    settings: int  # checksum of the settings now in use, 0 without

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            12 << 36
            | (self.refusal & 15) << 32
            | (self.field & 255) << 24
            | (self.settings & 16777215) << 0
        ).to_bytes(5, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Answer | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 5:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 32 & 15),
            (bits >> 24 & 255),
            (bits >> 0 & 16777215),
        )


class Capture(NamedTuple):
    """raw edges, both flanks, unfiltered"""

    sequence: int  # counts frames of this kind
    lost: int  # edges found no room
    used: int  # entries in use
    time: int  # 64 us, time of the first edge
    edges: tuple[int, ...]  # 1 bit wheel (0 left), 1 bit level, 14 bits of 64 us since the edge before

    def pack(self) -> bytes:
        """Payload bytes."""
        return (
            13 << 164
            | (self.sequence & 63) << 158
            | (self.lost & 1) << 157
            | (self.used & 15) << 153
            | (self.time & 33554431) << 128
            | (self.edges[0] & 65535) << 112
            | (self.edges[1] & 65535) << 96
            | (self.edges[2] & 65535) << 80
            | (self.edges[3] & 65535) << 64
            | (self.edges[4] & 65535) << 48
            | (self.edges[5] & 65535) << 32
            | (self.edges[6] & 65535) << 16
            | (self.edges[7] & 65535) << 0
        ).to_bytes(21, 'big')

    @classmethod
    def unpack(cls, payload: bytes) -> Capture | None:
        """The frame in a payload of this type, or None when it is malformed."""
        if len(payload) != 21:
            return None
        bits = int.from_bytes(payload, 'big')
        return cls(
            (bits >> 158 & 63),
            (bits >> 157 & 1),
            (bits >> 153 & 15),
            (bits >> 128 & 33554431),
            ((bits >> 112 & 65535), (bits >> 96 & 65535), (bits >> 80 & 65535), (bits >> 64 & 65535), (bits >> 48 & 65535), (bits >> 32 & 65535), (bits >> 16 & 65535), (bits >> 0 & 65535)),
        )


Frame = Command | Duty | Stop | Ask | Action | Settings | State | Counts | Status | Hello | Answer | Capture
OF_TYPE: dict[int, type[Frame]] = {1: Command, 2: Duty, 3: Stop, 4: Ask, 5: Action, 6: Settings, 8: State, 9: Counts, 10: Status, 11: Hello, 12: Answer, 13: Capture}
WIRE: dict[type[Frame], int] = {Command: 10, Duty: 10, Stop: 7, Ask: 7, Action: 7, Settings: 40, State: 21, Counts: 17, Status: 23, Hello: 15, Answer: 10, Capture: 26}  # bytes on the wire
