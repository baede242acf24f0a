"""The emulated board on a bench: frames in and out on both UARTs, pins driven by hand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from diffbotctl.emulator.emulated_robot import board_emulator
from diffbotctl.emulator.process import MotorChange, PinTransition, StepResult
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder, encode
from diffbotctl.links.diffbot_settings import BoardSettings, WheelSettings
from diffbotctl.time import MILLISECOND as MS

# The wheels of the bench do not follow the duty: only the feed-forward is used.
BOOK = BoardSettings(
    WheelSettings(5, 6, 7, 2, reversed=True, proportional=0.0, integral=0.0),
    WheelSettings(8, 9, 10, 3, proportional=0.0, integral=0.0),
    range_channel=0,
    range_name="front",
)
# The same on an Uno, whose A0 is pin 14, with the radio module on its only port.
UNO = replace(
    BOOK,
    board=frames.BoardCode.ATMEGA328P,
    left=replace(BOOK.left, in1=7, in2=8),
    right=replace(BOOK.right, enable=6),
    uart=0,
    shares_usb=True,
)
# A Pico has the pins of the bench Uno too.
PICO = replace(UNO, board=frames.BoardCode.RP2040)
UNO_ROBOT = str(Path(__file__).with_name("uno.yaml"))
PICO_ROBOT = str(Path(__file__).with_name("pico.yaml"))
ENCODERS = (2, 3)
BAUDS = (115200, 9600)
# What the chip's dividers make of them at 16 MHz (data sheet, table 22-12).
REAL_BAUDS = (117647, 9615)
RADIO, USB = 1, 0
COMMAND_BYTES = 10
DEADMAN_TARGET = 320 * MS  # from the last command to motors off: 300 ms, and what it takes


class BenchBoard(NamedTuple):
    """The board that trials run on: its settings on the bench, and its robot file."""

    settings: BoardSettings
    robot: str

    @property
    def ports(self) -> tuple[int, ...]:
        """Its serial ports: RADIO, and USB if that is another one."""
        return (RADIO,) if self.settings.shares_usb else (RADIO, USB)


MEGA_BOARD, UNO_BOARD = BenchBoard(BOOK, "book_2wd"), BenchBoard(UNO, UNO_ROBOT)
PICO_BOARD = BenchBoard(PICO, PICO_ROBOT)
PICO_HALL_BOARD = BenchBoard(PICO, str(Path(__file__).with_name("pico_hall.yaml")))
_board = ContextVar("board of the trials", default=MEGA_BOARD)


def trial_board() -> BenchBoard:
    """The board that trials run on at present."""
    return _board.get()


@contextmanager
def trials_on(board: BenchBoard) -> Iterator[None]:
    """Run trials on this board."""
    token = _board.set(board)
    try:
        yield
    finally:
        _board.reset(token)


class BenchFrame(NamedTuple):
    """A frame from the board, at the end of its last byte."""

    time: int
    uart: int
    frame: frames.Frame


class BoardBench:
    """One board. `duty` is what the motors get now, forward positive as the settings have it.

    On a board with one port RADIO and USB both mean that port.
    """

    def __init__(self, eeprom: bytes | None = None, settings: BoardSettings | None = None) -> None:
        """`settings`: default is those of `trial_board`."""
        settings = settings or trial_board().settings
        self.emulator = board_emulator(settings)
        if eeprom is not None:
            self.emulator.set_eeprom(eeprom)
            self.emulator.reset(1)
        self.settings = settings
        decoder = FrameDecoder()
        self.decoders = [decoder, decoder if settings.shares_usb else FrameDecoder()]
        self.received: list[BenchFrame] = []
        self.changes: list[MotorChange] = []
        self.duty = [0.0, 0.0]
        self.pending = [b"", b""]
        self.pins = [PinTransition(0, pin, 0) for pin in ENCODERS]
        self.was_reset = False

    def __enter__(self) -> BoardBench:
        return self

    def __exit__(self, *_: object) -> None:
        self.emulator.close()

    @property
    def now(self) -> int:
        return self.emulator.now

    def uart(self, port: int) -> int:
        """The board's UART that RADIO or USB leads to."""
        return 0 if self.settings.shares_usb else port

    def send(self, uart: int, *messages: frames.Frame | bytes) -> None:
        """Bytes or frames that begin to arrive when time goes on."""
        for each in messages:
            self.pending[self.uart(uart)] += each if isinstance(each, bytes) else encode(each)

    def run(self, until: int, millivolts: dict[int, int] | None = None) -> list[BenchFrame]:
        """Let time pass until `until` (ns); what came in the meantime."""
        due = sorted(change for change in self.pins if change.time <= until)
        self.pins = [change for change in self.pins if change.time > until]
        out = (self.pending[0], self.pending[1])
        self.pending = [b"", b""]
        result = self.emulator.step(until, due, millivolts, out)
        return self._take(result)

    def wait(self, ms: float) -> list[BenchFrame]:
        """Let `ms` milliseconds pass."""
        return self.run(self.now + round(ms * MS))

    def _take(self, result: StepResult) -> list[BenchFrame]:
        self.was_reset |= result.was_reset
        for change in result.changes:
            side = (self.settings.left, self.settings.right)[change.motor]
            self.duty[change.motor] = -change.duty if side.reversed else change.duty
            self.changes.append(change)
        new = []
        for sent in result.sent:
            for frame in self.decoders[sent.uart].feed(bytes((sent.byte,))):
                new.append(BenchFrame(sent.time, sent.uart, frame))
        self.received += new
        return new

    def ask(self, uart: int = RADIO) -> frames.HelloFrame:
        """Greet the board. Raises LookupError when it does not answer."""
        self.send(uart, b"\0", frames.AskFrame(frames.VERSION))
        return next(h.frame for h in self.wait(80) if isinstance(h.frame, frames.HelloFrame))

    def configure(
        self, settings: BoardSettings | frames.SettingsFrame, uart: int = RADIO
    ) -> frames.AnswerFrame:
        """Send settings; the answer. Raises LookupError when there is none."""
        self.send(
            uart,
            b"\0",
            settings if isinstance(settings, frames.SettingsFrame) else settings.frame(),
        )
        for _ in range(4):
            for received in self.wait(60):
                if isinstance(received.frame, frames.AnswerFrame):
                    return received.frame
        raise LookupError("no answer to settings")

    def claim(self, uart: int = RADIO, sequence: int = 15) -> None:
        """Own the commands."""
        self.send(uart, b"\0", frames.StopFrame(sequence))
        self.wait(12)  # 7 bytes at 9600 baud, and a period of the main loop

    def ready(self, uart: int = RADIO) -> None:
        """Settings in use, commands owned."""
        self.wait(30)
        self.ask(uart)
        answer = self.configure(self.settings, uart)
        if answer.refusal:
            raise LookupError(f"settings refused: {answer}")
        self.claim(uart)

    def inertial(self) -> frames.InertialFrame:
        """The last frame with a turn. Raises LookupError when there was none."""
        return next(
            h.frame for h in reversed(self.received) if isinstance(h.frame, frames.InertialFrame)
        )

    def state(self) -> frames.StateFrame:
        """The last state frame. Raises LookupError when there was none."""
        return next(
            h.frame for h in reversed(self.received) if isinstance(h.frame, frames.StateFrame)
        )

    def turn(self, seconds: float, rate: float = 30.0) -> None:
        """Let both encoders give `rate` edges a second for a while from now on."""
        period = round(1e9 / rate)
        for index in range(1, int(seconds * rate) + 1):
            rise = self.now + index * period
            for pin in ENCODERS:
                self.pins += [
                    PinTransition(rise, pin, 1),
                    PinTransition(rise + period // 2, pin, 0),
                ]


def speed(sequence: int, left: float, right: float) -> frames.CommandFrame:
    """A command of wheel speeds in rad/s."""
    one = frames.SPEED_ONE
    return frames.CommandFrame(sequence & 0xF, round(left * one), round(right * one))


def wire_ns(uart: int, size: int) -> int:
    """How long `size` bytes are on the wire."""
    return size * 10 * 1_000_000_000 // REAL_BAUDS[uart]
