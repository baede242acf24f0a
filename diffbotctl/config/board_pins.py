"""Pin functions of each board, from the data sheets and board drawings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple


class BoardSupplyPins(NamedTuple):
    """Names of the supply pins of a board: of 5 V in, of 5 V out, and of what its pins take."""

    into: str
    out: str
    logic: str


FIVE_VOLTS = BoardSupplyPins("5V", "5V", "5V")


@dataclass(frozen=True, eq=False, repr=False)
class BoardPins:
    """One type of board. Pins have their printed names; an analog pin also has a digital number.

    `interrupts` are pins for encoders, `changes` pins whose changes raise an interrupt too.
    `pwm` maps a pin to its timer, `uarts` a port to its (receive, transmit) pins. By protocol,
    `clock_timer` is the timer that the firmware uses for its clock, whose PWM is not available, and
    `links` are the ports that the firmware uses. `chip` is its name in the
    protocol: one firmware serves all boards with it. `i2c` are the (SDA, SCL) pins of its bus.

    `volts` is the most that its pins take, `led` the pin of its LED, if it has one, `supply` its
    pins of supply. Port 0 is also the USB port if `has_usb_serial`. With `shares_pwm`, `pwm` maps a
    pin to its PWM output, which another pin may have too.
    """

    title: str
    digital: tuple[str, ...]
    analog: tuple[str, ...]
    analog_only: tuple[str, ...]
    first_analog: int
    pwm: dict[str, int]
    interrupts: tuple[str, ...]
    changes: tuple[str, ...]
    uarts: dict[int, tuple[str, str]]
    clock_timer: dict[str, int]
    links: dict[str, tuple[int, ...]]
    chip: str
    i2c: tuple[str, str]
    volts: float = 5.0
    led: str | None = "13"
    supply: BoardSupplyPins = FIVE_VOLTS
    has_usb_serial: bool = True
    shares_pwm: bool = False
    counts_of_slot: int = 1
    """counts that the firmware makes of a slot of an encoder with two channels"""
    slot_rate: int = 12_000
    """slots of an encoder with two channels that it counts in a second, of each of two"""

    @property
    def image(self) -> str:
        """Name of the file with our firmware."""
        kind = "uf2" if self.chip == "RP2040" else "hex"
        return f"diffbot_{self.chip.lower()}.{kind}"

    @property
    def shares_usb(self) -> bool:
        """True when the USB cable and a radio module share the only port of our firmware.

        Its baud rate is a setting then; else a USB port always runs at 115200 baud.
        """
        return len(self.links["diffbot"]) == 1

    @property
    def with_article(self) -> str:
        """Its title after the indefinite article."""
        return f"{'an' if self.title[0] in 'AEIOU' else 'a'} {self.title}"

    def number(self, pin: object) -> int:
        """The board's number of a pin that is written `5` or `A0`."""
        text = str(pin)
        return self.first_analog + int(text[1:]) if text.startswith("A") else int(text)

    def named(self, pin: str) -> str:
        """The name of `pin` in the tables: 54 of a Mega 2560 is A0."""
        if pin.isdigit() and pin not in self.digital:
            name = f"A{int(pin) - self.first_analog}"
            return name if name in self.analog else pin
        return pin

    def has(self, pin: str) -> bool:
        """True when the board has the pin `pin`, a name returned by `named`."""
        return pin in self.digital or pin in self.analog


def _pwm(pins_of_timer: dict[int, str]) -> dict[str, int]:
    return {pin: timer for timer, pins in pins_of_timer.items() for pin in pins.split()}


NO_TIMER = -1  # a clock beside the PWM units

MEGA_2560 = BoardPins(
    title="Mega 2560",
    digital=tuple(str(number) for number in range(54)),
    analog=tuple(f"A{number}" for number in range(16)),
    analog_only=(),
    first_analog=54,
    pwm=_pwm({0: "4 13", 1: "11 12", 2: "9 10", 3: "2 3 5", 4: "6 7 8", 5: "44 45 46"}),
    interrupts=("2", "3", "18", "19", "20", "21"),
    changes=tuple(str(number) for number in (*range(10, 14), *range(50, 54))),
    uarts={0: ("0", "1"), 1: ("19", "18"), 2: ("17", "16"), 3: ("15", "14")},
    clock_timer={"diffbot": 1, "rosserial": 0},
    links={"diffbot": (0, 1), "rosserial": (0, 1, 2, 3)},
    chip="MEGA2560",
    i2c=("20", "21"),
)

NANO = BoardPins(
    title="Nano",
    digital=tuple(str(number) for number in range(14)),
    analog=tuple(f"A{number}" for number in range(8)),
    analog_only=("A6", "A7"),
    first_analog=14,
    pwm=_pwm({0: "5 6", 1: "9 10", 2: "3 11"}),
    interrupts=("2", "3"),
    changes=(*map(str, range(2, 14)), *(f"A{n}" for n in range(6))),
    uarts={0: ("0", "1")},
    clock_timer={"diffbot": 2, "rosserial": 0},
    links={"diffbot": (0,), "rosserial": (0,)},
    chip="ATMEGA328P",
    i2c=("A4", "A5"),
)

# The same chip in a package without A6 and A7.
UNO = replace(NANO, title="Uno", analog=NANO.analog[:6], analog_only=())

# Numbers of its GP pins; A0 to A2 are GP26 to GP28. The others serve its supply and its LED. Pins
# 16 numbers apart have one PWM output.
PICO = BoardPins(
    title="Pico",
    digital=tuple(str(number) for number in range(23)),
    analog=("A0", "A1", "A2"),
    analog_only=(),
    first_analog=26,
    pwm={str(number): number % 16 for number in range(2, 23)},
    interrupts=tuple(str(number) for number in range(2, 23)),
    changes=tuple(str(number) for number in range(2, 23)),
    uarts={0: ("1", "0")},
    clock_timer={"diffbot": NO_TIMER, "rosserial": NO_TIMER},
    links={"diffbot": (0,), "rosserial": ()},
    chip="RP2040",
    i2c=("4", "5"),
    volts=3.3,
    led=None,
    supply=BoardSupplyPins("VSYS", "VBUS", "3V3"),
    has_usb_serial=False,
    shares_pwm=True,
    counts_of_slot=4,
    slot_rate=20_000,
)

SIMULATED = "simulated"  # board type of a robot that exists only in the simulator
BOARDS = {"mega2560": MEGA_2560, "uno": UNO, "nano": NANO, "pico": PICO}
