"""Pin functions of each board; the rows are in parts/boards.yaml."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from diffbotctl import parts


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


def _board(row: dict[str, Any]) -> BoardPins:
    """A row of the table, which has numbers of pins in place of names, and counts of pins."""
    names = {
        "digital": tuple(map(str, range(row["digital"]))),
        "analog": tuple(f"A{number}" for number in range(row["analog"])),
        "pwm": {str(pin): output for output, pins in row["pwm"].items() for pin in pins},
        "uarts": {port: tuple(map(str, pins)) for port, pins in row["uarts"].items()},
        "supply": BoardSupplyPins(*row.get("supply", FIVE_VOLTS)),
    }
    for column in ("analog_only", "interrupts", "changes", "i2c"):
        names[column] = tuple(map(str, row[column]))
    return BoardPins(**row | names)


SIMULATED = "simulated"  # board type of a robot that exists only in the simulator
BOARDS = {name: _board(row) for name, row in parts.rows("boards").items()}
