"""Pin functions of each board, from the data sheets and board drawings."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BoardPins:
    """One type of board. Pins have their printed names; an analog pin also has a digital number.

    `pwm` maps a pin to its timer, `uarts` a port to its (receive, transmit) pins. By protocol,
    `clock_timer` is the timer that the firmware uses for its clock, whose PWM is not available, and
    `links` are the ports that the firmware uses.
    """

    title: str
    digital: tuple[str, ...]
    analog: tuple[str, ...]
    analog_only: tuple[str, ...]
    first_analog: int
    pwm: dict[str, int]
    interrupts: tuple[str, ...]
    uarts: dict[int, tuple[str, str]]
    clock_timer: dict[str, int]
    links: dict[str, tuple[int, ...]]

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


MEGA_2560 = BoardPins(
    title="Mega 2560",
    digital=tuple(str(number) for number in range(54)),
    analog=tuple(f"A{number}" for number in range(16)),
    analog_only=(),
    first_analog=54,
    pwm=_pwm({0: "4 13", 1: "11 12", 2: "9 10", 3: "2 3 5", 4: "6 7 8", 5: "44 45 46"}),
    interrupts=("2", "3", "18", "19", "20", "21"),
    uarts={0: ("0", "1"), 1: ("19", "18"), 2: ("17", "16"), 3: ("15", "14")},
    clock_timer={"diffbot": 1, "rosserial": 0},
    links={"diffbot": (0, 1), "rosserial": (0, 1, 2, 3)},
)

ATMEGA_328P = BoardPins(
    title="ATmega328P",
    digital=tuple(str(number) for number in range(14)),
    analog=tuple(f"A{number}" for number in range(8)),
    analog_only=("A6", "A7"),
    first_analog=14,
    pwm=_pwm({0: "5 6", 1: "9 10", 2: "3 11"}),
    interrupts=("2", "3"),
    uarts={0: ("0", "1")},
    clock_timer={"diffbot": 0, "rosserial": 0},
    links={"diffbot": (0,), "rosserial": (0,)},
)

SIMULATED = "simulated"  # board type of a robot that exists only in the simulator
BOARDS = {"mega2560": MEGA_2560, "atmega328p": ATMEGA_328P}
