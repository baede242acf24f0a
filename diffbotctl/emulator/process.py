"""The emulated board: a Mega 2560 that runs the real firmware, stepped in lockstep with a plant."""

from __future__ import annotations

import hashlib
import os
import shutil
import struct
import subprocess
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from diffbotctl.config.lookup import folder
from diffbotctl.errors import Problem, RunError

FIRMWARE = folder("firmware")
IMAGE = FIRMWARE / "diffbot_mega2560.hex"
BOOTLOADER = Path(
    "/usr/share/arduino/hardware/arduino/avr/bootloaders/stk500v2/stk500boot_v2_mega2560.hex"
)
SOURCES = FIRMWARE / "emulator"
SIMAVR = "libsimavr-dev"
EEPROM_SIZE = 4096
DUTY_ONE = 32767
# Reset causes, as bits of the chip's MCUSR register (data sheet, section 12.5).
POWER, LINE, BROWNOUT, WATCHDOG = 1, 2, 4, 8
EXIT_TIMEOUT_S = 5.0

_HEAD = struct.Struct("<cQHHHH")
_TRANSITION = struct.Struct("<IBB")
_ANALOG = struct.Struct("<BH")
_REPLY = struct.Struct("<QHHB")
_EVENT = struct.Struct("<IBhB")
_BYTE = struct.Struct("<IBB")


class EmulatorError(RunError):
    """The emulator cannot be built, or has crashed."""

    def __init__(self, cause: str, fix: str = "run again with --debug and report the output"):
        super().__init__(Problem("E-EMULATOR", "emulated board", cause, fix))


class PinTransition(NamedTuple):
    """A pin driven from outside."""

    time: int  # ns of board time
    pin: int  # Arduino number
    level: int  # 0 or 1


class MotorChange(NamedTuple):
    """What a motor's bridge was switched to."""

    time: int  # ns of board time
    motor: int  # index in the list of motors passed to the emulator
    duty: float  # -1 to 1; positive when the first input is high and the second low
    brake: bool  # true when the bridge shorts the motor, false when it leaves it open or drives it


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
    crashed: bool

    def bytes_of(self, uart: int) -> bytes:
        """All bytes sent on one UART in this step."""
        return bytes(sent.byte for sent in self.sent if sent.uart == uart)


def build(into: Path | None = None) -> Path:
    """The emulator's program, compiled into a cache folder when it is not there yet.

    Raises EmulatorError naming the Debian packages when a compiler or simavr is missing.
    """
    sources = sorted(SOURCES.glob("*.c"))
    if not sources:
        raise EmulatorError(f"its sources are not in {SOURCES}", "use a checkout")
    mark = hashlib.sha256()
    for source in sorted(SOURCES.glob("*.[ch]")):
        mark.update(source.read_bytes())
    program = (into or cache()) / f"emulator-{mark.hexdigest()[:16]}"
    if not program.exists():
        _compile(sources, program)
    return program


def _require(boots: bool = False) -> None:
    """Raises EmulatorError with all Debian packages that are missing to build it, and to boot."""
    missing = [
        what
        for what, here in (
            ("gcc", shutil.which("gcc") is not None),
            ("libc6-dev", Path("/usr/include/stdlib.h").exists()),
            (SIMAVR, Path("/usr/include/simavr/sim_avr.h").exists()),
            ("arduino-core-avr", not boots or BOOTLOADER.exists()),
        )
        if not here
    ]
    if missing:
        why = "it is built on this machine, and packages are missing"
        raise EmulatorError(why, f"sudo apt-get install {' '.join(missing)}")


def _compile(sources: list[Path], program: Path) -> None:
    _require()
    compiler = shutil.which("gcc") or "gcc"
    program.parent.mkdir(parents=True, exist_ok=True)
    partial = program.with_name(f"{program.name}.{os.getpid()}")
    options = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-o"]
    command = [compiler, *options, str(partial), *map(str, sources), "-lsimavr"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise EmulatorError(f"it does not compile; gcc says:\n{done.stderr.strip()}")
    partial.replace(program)


def bootloader() -> Path:
    """The stock bootloader's image, without the records that simavr complains of.

    Raises EmulatorError naming the Debian package when it is not installed.
    """
    if not BOOTLOADER.exists():
        _require(boots=True)
    kept = [line for line in BOOTLOADER.read_text("ascii").splitlines(True) if line[7:9] != "03"]
    copy = cache() / "stk500boot_v2_mega2560.hex"
    copy.parent.mkdir(parents=True, exist_ok=True)
    partial = copy.with_name(f"{copy.name}.{os.getpid()}")
    partial.write_text("".join(kept), "ascii")
    partial.replace(copy)
    return copy


def cache() -> Path:
    """Folder of the compiled emulator."""
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "diffbotctl"


class Emulator:
    """One emulated board. Times are ns of board time; every run with equal input is equal.

    `motors`: the (enable, in1, in2) pins of each motor. With `pty` the UARTs are
    pseudo-terminals named by `ports`, and opening the first resets the board. With `paced` the
    board follows real time by itself and takes no steps.
    """

    def __init__(
        self,
        motors: list[tuple[int, int, int]],
        *,
        image: Path | None = IMAGE,
        boot: Path | None = None,
        eeprom: Path | None = None,
        pty: bool = False,
        paced: bool = False,
    ) -> None:
        command = [str(build())]
        for option, path in (("--hex", image), ("--boot", boot), ("--eeprom", eeprom)):
            command += [option, str(path)] if path else []
        for pins in motors:
            command += ["--motor", ",".join(map(str, pins))]
        command += ["--pty"] * pty + ["--paced"] * paced
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self._process.stdin is not None and self._process.stdout is not None
        self._requests, self._replies = self._process.stdin, self._process.stdout
        self._lock = Lock()  # one request and its reply at a time, from any thread
        self.now = 0
        self.ports: tuple[str, str] | None = None
        if pty:
            self.ports = self._ports()

    def _ports(self) -> tuple[str, str]:
        names = self._replies.readline().decode().split()
        if len(names) != 2:
            self.close()
            raise EmulatorError("it did not start", f"sudo apt-get install {SIMAVR}")
        return names[0], names[1]

    def step(
        self,
        until: int,
        transitions: list[PinTransition] | None = None,
        millivolts: dict[int, int] | None = None,
        received: tuple[bytes, bytes] = (b"", b""),
    ) -> StepResult:
        """Run to `until`, with pins changing on the way and bytes arriving from now on.

        `millivolts` gives analog channels (A0 is 0); `received` is what goes into each UART, at its
        own baud rate. Raises EmulatorError when the emulator has crashed.
        """
        changes = transitions or []
        analogs = millivolts or {}
        parts = [_HEAD.pack(b"S", until, len(changes), len(analogs), *map(len, received))]
        parts += [
            _TRANSITION.pack(max(0, time - self.now), pin, level) for time, pin, level in changes
        ]
        parts += [_ANALOG.pack(channel, value) for channel, value in analogs.items()]
        with self._lock:
            self._write(b"".join([*parts, *received]))
            return self._result()

    def _result(self) -> StepResult:
        began = self.now
        self.now, events, sent, flags = _REPLY.unpack(self._read(_REPLY.size))
        data = self._read(events * _EVENT.size + sent * _BYTE.size)
        split = events * _EVENT.size
        changes = [
            MotorChange(began + after, motor, duty / DUTY_ONE, bool(brake))
            for after, motor, duty, brake in _EVENT.iter_unpack(data[:split])
        ]
        whole = [
            SentByte(began + after, uart, byte)
            for after, uart, byte in _BYTE.iter_unpack(data[split:])
        ]
        return StepResult(self.now, changes, whole, bool(flags & 1), bool(flags & 2))

    def reset(self, cause: int = LINE) -> None:
        """Pull the reset line, or reset for another cause."""
        self._request(bytes((ord("R"), cause)), 1)

    def hang(self) -> None:
        """The main program stops making progress from now on; interrupts still run."""
        self._request(b"H", 1)

    def eeprom(self) -> bytes:
        """All bytes of the EEPROM."""
        return self._request(b"Q", EEPROM_SIZE)

    def set_eeprom(self, content: bytes) -> None:
        """Put `content` into the EEPROM, as if it had always been there."""
        self._request(b"W" + content.ljust(EEPROM_SIZE, b"\xff"), 1)

    def flash(self, offset: int, length: int) -> bytes:
        """Bytes of the flash."""
        return self._request(b"F" + struct.pack("<II", offset, length), length)

    def dirty_writes(self) -> int:
        """Number of flash words that were written without having been erased."""
        return int.from_bytes(self._request(b"D", 4), "little")

    def close(self) -> None:
        """End the emulator."""
        if self._process.poll() is None:
            self._requests.close()
            try:
                self._process.wait(EXIT_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._replies.close()

    def __enter__(self) -> Emulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _request(self, data: bytes, reply_size: int) -> bytes:
        with self._lock:
            self._write(data)
            return self._read(reply_size)

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
