"""The emulated board: it runs the real firmware, stepped in lockstep with a plant."""

from __future__ import annotations

import select
import struct
import subprocess
from collections.abc import Sequence
from enum import IntEnum
from pathlib import Path
from threading import Lock
from typing import Literal, NamedTuple

from diffbotctl.drivers.robot_ports import mark_emulated
from diffbotctl.emulator.program import (
    CHIPS,
    SIMAVR,
    EmulatorError,
    build,
    image_of,
    rp2040_program,
)
from diffbotctl.emulator.pseudo_terminal import PseudoTerminal, UsbTerminal
from diffbotctl.links.diffbot_frames import DUTY_ONE, PIN_NONE, BoardCode
from diffbotctl.processes.real_time import prefer
from diffbotctl.time import SECOND

EEPROM_SIZE = 4096
# Reset causes, as bits of the chip's MCUSR register (data sheet, section 12.5).
POWER, LINE, BROWNOUT, WATCHDOG = 1, 2, 4, 8
FIRST_SONAR = 128  # analog channel of the first HC-SR04: the length of its echo, us
SONAR_SILENT, SONAR_ENDLESS = 0, 0xFFFF  # it does not answer; its echo does not end
FIRST_GYRO = 160  # channels of the gyro's rates about x, y and z
GYRO_FAULT = FIRST_GYRO + 3  # channel of its fault, a GyroFault
GYRO_RATE_UNIT = 0.02  # deg/s
GYRO_ACCELERATION = FIRST_GYRO + 4  # channels of the accelerations along x, y and z, signed
GYRO_ONE_G = 16384  # in these channels
SHORTING = {"enable_low": 1, "both_low": 2, "both_high": 4}  # states of a driver's inputs
EXIT_TIMEOUT_S = 5.0
ANSWER_TIMEOUT_S = 30.0  # for a step, also on a busy computer; then it is suspended

Firmware = Literal["ours"]  # the firmware of diffbotctl for the board

RESET, CRASHED, IN_BOOTSEL = 1, 2, 4  # flags of a step's reply

_HEAD = struct.Struct("<cQHHHH")
_TRANSITION = struct.Struct("<IBB")
_ANALOG = struct.Struct("<BH")
_REPLY = struct.Struct("<QHHB")
_EVENT = struct.Struct("<IBhh")
_BYTE = struct.Struct("<IBB")


class GyroFault(IntEnum):
    """What the emulated gyro does wrong."""

    NONE = 0
    SILENT = 1  # it does not answer
    BUS_HELD = 2  # the bus is low for ever
    BUS_IN_READING = 3  # the gyro holds the bus until the clock has ended its reading
    STUCK = 4  # its rates do not change any more
    SUPPLY_DIP = 5  # it has lost its settings


class MotorPins(NamedTuple):
    """The board's pins of one motor; 255 for an input that its driver does not have.

    `shorts`: bits of the states of its inputs in which the driver shorts the motor, a set of
    `SHORTING`; in others it leaves it open. Default: an L298N.
    """

    enable: int
    in1: int
    in2: int
    standby: int = PIN_NONE
    shorts: int = SHORTING["both_low"] | SHORTING["both_high"]


class PinTransition(NamedTuple):
    """A pin driven from outside."""

    time: int  # ns of board time
    pin: int  # Arduino number
    level: int  # 0 or 1


class SonarPins(NamedTuple):
    """The board's pins of an HC-SR04."""

    trigger: int
    echo: int


class MotorChange(NamedTuple):
    """What a motor's driver does from now on, as shares of each pulse; for the rest it is open."""

    time: int  # ns of board time
    motor: int  # index in the list of motors passed to the emulator
    duty: float  # -1 to 1; positive when the first input is high and the second low
    shorted: float  # 0 to 1


class SentByte(NamedTuple):
    """A byte that the board has sent, at the end of its stop bit."""

    time: int  # ns of board time
    uart: int
    byte: int


class StepResult(NamedTuple):
    """What the board did in one step."""

    now: int  # ns of board time reached
    changes: list[MotorChange]
    sent: list[SentByte]
    was_reset: bool
    in_bootsel: bool = False  # a Pico shows its boot drive and runs no program

    def bytes_of(self, uart: int) -> bytes:
        return bytes(sent.byte for sent in self.sent if sent.uart == uart)


class Emulator:
    """One emulated board. Times are ns of board time; every run with equal input is equal.

    `motors`: the pins of each motor. `gyro`: the I2C address of a gyro, 0 for none.
    `image`: default is the board's firmware.
    The UARTs of a Pico are its UART0 and its USB port. With `pty` the ports are pseudo-terminals
    named by `ports`, the one of USB first; opening that resets an AVR board. With `paced` the
    board follows real time by itself and takes no steps.
    """

    def __init__(
        self,
        motors: Sequence[MotorPins | tuple[int, int, int]],
        *,
        board: BoardCode = BoardCode.MEGA2560,
        image: Path | Firmware | None = "ours",
        boot: Path | None = None,
        eeprom: Path | None = None,
        pty: bool = False,
        paced: bool = False,
        sonars: Sequence[SonarPins] = (),
        gyro: int = 0,
    ) -> None:
        if image == "ours":
            image = image_of(board)
        if board in CHIPS:
            command = [str(build()), "--chip", CHIPS[board].name]
            image_option = "--hex"
        else:
            command, image_option = rp2040_program(), "--image"
        for option, path in ((image_option, image), ("--boot", boot), ("--eeprom", eeprom)):
            command += [option, str(path)] if path else []
        for pins in motors:
            command += ["--motor", ",".join(map(str, MotorPins(*pins)))]
        for sonar in sonars:
            command += ["--sonar", ",".join(map(str, sonar))]
        command += ["--gyro", str(gyro)] if gyro else []
        self._usb: UsbTerminal | None = None  # of a Pico; beside it its UART
        self._uart: PseudoTerminal | None = None
        if board in CHIPS:
            command += ["--pty"] * pty + ["--paced"] * paced
        elif pty:
            self._usb, self._uart = UsbTerminal(), PseudoTerminal()
        # In a group of its own: Ctrl-C in a terminal ends the engine, which first stops the robot.
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, process_group=0
        )
        if pty or paced:  # otherwise its time waits for the caller
            prefer(self._process.pid)
        assert self._process.stdin is not None and self._process.stdout is not None
        self._requests, self._replies = self._process.stdin, self._process.stdout
        self._lock = Lock()  # one request and its reply at a time, from any thread
        self._poll = select.poll()
        self._poll.register(self._replies, select.POLLIN)
        self.now = 0
        self.ports: tuple[str, ...] | None = None
        if self._usb is not None and self._uart is not None:
            self.ports = (self._usb.name, self._uart.name)
        elif pty:
            self.ports = self._ports()
        for port in self.ports or ():
            mark_emulated(port)

    @property
    def pid(self) -> int:
        return self._process.pid

    def _ports(self) -> tuple[str, ...]:
        names = self._replies.readline().decode().split()
        if not names:
            self.close()
            raise EmulatorError("it did not start", f"sudo apt-get install {SIMAVR}")
        return tuple(names)

    def step(
        self,
        until: int,
        transitions: list[PinTransition] | None = None,
        millivolts: dict[int, int] | None = None,
        received: tuple[bytes, bytes] = (b"", b""),
    ) -> StepResult:
        """Run to `until`, with pins changing on the way and bytes arriving from now on.

        `millivolts` gives analog channels (A0 is 0), and from FIRST_SONAR on the echoes of the
        HC-SR04 sensors in us, from FIRST_GYRO on the gyro's rates (signed) in GYRO_RATE_UNIT, its
        fault and its accelerations; `received` is what goes into each UART, at its
        own baud rate. Raises EmulatorError when the emulator has crashed.
        """
        if self._usb is not None and self._uart is not None:
            if self._usb.changed():
                self.set_usb_port(self._usb.baud, self._usb.is_open)
            received = (self._uart.read(), self._usb.read())
        changes = transitions or []
        analogs = millivolts or {}
        parts = [_HEAD.pack(b"S", until, len(changes), len(analogs), *map(len, received))]
        parts += [
            _TRANSITION.pack(max(0, time - self.now), pin, level) for time, pin, level in changes
        ]
        parts += [_ANALOG.pack(channel, value & 0xFFFF) for channel, value in analogs.items()]
        with self._lock:
            self._write(b"".join([*parts, *received]))
            result = self._result()
        if self._usb is not None and self._uart is not None and result.sent:
            self._uart.write(result.bytes_of(0))
            self._usb.write(result.bytes_of(1))
        return result

    def _result(self) -> StepResult:
        began = self.now
        self._await_reply()
        self.now, events, sent, flags = _REPLY.unpack(self._read(_REPLY.size))
        data = self._read(events * _EVENT.size + sent * _BYTE.size)
        split = events * _EVENT.size
        changes = [
            MotorChange(began + after, motor, duty / DUTY_ONE, shorted / DUTY_ONE)
            for after, motor, duty, shorted in _EVENT.iter_unpack(data[:split])
        ]
        whole = [
            SentByte(began + after, uart, byte)
            for after, uart, byte in _BYTE.iter_unpack(data[split:])
        ]
        if flags & CRASHED:
            raise EmulatorError(
                f"after {self.now / SECOND:.3f} s its program did what the chip cannot do",
                "start it with a program that was built for this board",
            )
        return StepResult(self.now, changes, whole, bool(flags & RESET), bool(flags & IN_BOOTSEL))

    def reset(self, cause: int = LINE) -> None:
        self._request(bytes((ord("R"), cause)), 1)

    def hang(self) -> None:
        """The main program stops making progress from now on; interrupts still run."""
        self._request(b"H", 1)

    def pulses(self, pin: int, high: int, low: int, jitter: int = 0) -> None:
        """Pulses at a pin from now on, made by the emulator itself, in place of its former ones.

        `high` and `low` are the durations (ns, at least 63) of the levels, `jitter` the largest
        random addition to each of them; 0, 0 ends the pulses.
        """
        self._request(b"P" + struct.pack("<BIII", pin, high, low, jitter), 1)

    def eeprom(self) -> bytes:
        return self._request(b"Q", EEPROM_SIZE)

    def set_eeprom(self, content: bytes) -> None:
        """Put `content` into the EEPROM, as if it had always been there."""
        self._request(b"W" + content.ljust(EEPROM_SIZE, b"\xff"), 1)

    def flash(self, offset: int, length: int) -> bytes:
        return self._request(b"F" + struct.pack("<II", offset, length), length)

    def dirty_writes(self) -> int:
        """Number of flash words that were written without having been erased."""
        return int.from_bytes(self._request(b"D", 4), "little")

    def set_usb_port(self, baud: int, is_open: bool) -> None:
        """A program opens or closes the USB port of a Pico; without `pty` it is open."""
        self._request(b"L" + struct.pack("<IB", baud, is_open), 1)

    def program(self, image: bytes) -> None:
        """Copy a UF2 file onto the drive of a Pico in BOOTSEL, which then starts it."""
        self._request(b"U" + struct.pack("<I", len(image)) + image, 1)

    def close(self) -> None:
        if self._process.poll() is None:
            self._requests.close()
            try:
                self._process.wait(EXIT_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._replies.close()
        for terminal in (self._usb, self._uart):
            if terminal is not None:
                terminal.close()
        self._usb = self._uart = None

    def __enter__(self) -> Emulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _request(self, data: bytes, reply_size: int) -> bytes:
        with self._lock:
            self._write(data)
            self._await_reply()
            return self._read(reply_size)

    def _await_reply(self) -> None:
        """Wait for the first byte of a reply; the rest of it comes in the same write."""
        if not self._poll.poll(ANSWER_TIMEOUT_S * 1000):
            self._process.kill()
            raise EmulatorError("it does not answer: it was suspended")

    def _write(self, data: bytes) -> None:
        try:
            self._requests.write(data)
            self._requests.flush()
        except BrokenPipeError:
            raise EmulatorError("it has crashed") from None

    def _read(self, size: int) -> bytes:
        data = self._replies.read(size)
        if len(data) != size:
            raise EmulatorError("it has crashed")
        return data
