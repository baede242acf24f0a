"""Motor drivers: inputs, supply, electrical figures and printed names of the pins.

The rows are in parts/motor_drivers.yaml. The figures are typical ones of the data sheet named by
`source`. Voltages are those of the motor supply, currents continuous ones of one motor. Only the
checks, the wiring and the plant read them: what an estimator knows of a robot is measured on it.
"""

from __future__ import annotations

import re
from typing import Any, Literal, NamedTuple

from diffbotctl import parts
from diffbotctl.config.unsupported_parts import UnsupportedPart

# Inputs of one motor: PWM, two directions; PWM, one direction; two PWMs.
DriverMode = Literal["enable_in1_in2", "enable_direction", "two_pwm"]
MOTOR_INPUTS: dict[DriverMode, tuple[str, ...]] = {
    "enable_in1_in2": ("enable", "in1", "in2"),
    "enable_direction": ("enable", "in1"),
    "two_pwm": ("in1", "in2"),
}
MODE_TEXT: dict[DriverMode, str] = {
    "enable_in1_in2": "a PWM input (enable) and two direction inputs (in1, in2)",
    "enable_direction": "a PWM input (enable) and a direction input (in1)",
    "two_pwm": "two PWM inputs (in1, in2)",
}


# What the bridge does with the motor: leaves its terminals open, or connects them.
OffState = Literal["open", "shorted"]

THRESHOLD_SHARE_MAX = 0.9  # of a battery that hardly exceeds the threshold
LETTERS_AFTER_AN = "AEFHILMNORSX"  # their names begin with a vowel: an L298N, an MX1508
# Words with which the inputs stay the same: those left out of any name; makers, amounts, revisions.
HARMLESS = re.compile("module|driver|board|breakout|dual|motors?|h|h?bridge|mosfet|channels?|red")
BESIDE = re.compile(r"adafruit|pololu|carrier|chip|dc|e|x?\d{1,2}([avx]|ch)?|(v|r|rev)\d{0,2}")


class BridgeFigures(NamedTuple):
    """Electrical figures of one bridge.

    Both transistors in the current's path together lose `threshold` (V) plus `resistance` (ohm)
    times the current. `off_state` is that between two pulses of the PWM, as our firmware drives the
    inputs: a current that dies at once (open, fast decay) or goes on (shorted, slow decay).
    """

    current: float  # A, continuous
    threshold: float  # V
    resistance: float  # ohm
    off_state: OffState
    has_thermal_shutdown: bool
    source: str

    def threshold_share(self, full: float) -> float:
        """`threshold` over the voltage (V) of the full battery."""
        return min(self.threshold / full, THRESHOLD_SHARE_MAX)

    def drop(self, current: float) -> float:
        """Voltage (V) lost at `current` (A)."""
        return self.threshold + self.resistance * current


class DriverNames(NamedTuple):
    """Printed names of the terminals of one half; None for an input that the driver lacks."""

    enable: str | None
    in1: str | None
    in2: str | None
    first_output: str
    second_output: str


class MotorDriverFacts(NamedTuple):
    """One type of driver board for two motors, or of two boards for one motor each.

    `states`: what the bridge does in the states `enable_low`, `both_low` and `both_high` of its
    inputs, as far as it has them.
    """

    title: str
    mode: DriverMode
    supply: tuple[float, float]  # V, motor supply
    bridge: BridgeFigures
    states: dict[str, OffState]
    left: DriverNames
    right: DriverNames
    supply_pin: str = "VM"
    logic_pin: str | None = None  # supplied with 5 V by the board
    standby: str | None = None
    always_high: str | None = None  # an input that has to be connected to the board's logic supply
    follows_input_pulses: bool = False  # beside enable: in1 and in2 take pulses of 1 kHz
    other_names: tuple[str, ...] = ()

    @property
    def with_article(self) -> str:
        is_word = self.title[1:2].islower()
        vowel = self.title[0] in LETTERS_AFTER_AN and not is_word
        return f"{'an' if vowel else 'a'} {self.title}"

    @property
    def current(self) -> float:
        """Continuous current (A) of one motor."""
        return self.bridge.current

    @property
    def rests(self) -> tuple[str, ...]:
        """The values of `idle` that the firmware can bring about.

        At rest it lowers the PWM inputs to coast, and raises both inputs to brake where there are
        two.
        """
        if self.mode == "enable_in1_in2":
            return ("coast", "brake")
        if self.bridge.off_state == "shorted":
            return ("brake",)
        return ("coast", "brake") if self.states.get("both_high") == "shorted" else ("coast",)

    def inputs(self) -> tuple[str, ...]:
        """The pins of a motor in the robot file that the driver has."""
        return MOTOR_INPUTS[self.mode]


def _facts(row: dict[str, Any]) -> MotorDriverFacts:
    """A row of the table; the firmware pulses `enable`, or one of two PWM inputs."""
    halves = {side: DriverNames(*row[side]) for side in ("left", "right")}
    off_state = row["states"]["both_low" if row["mode"] == "two_pwm" else "enable_low"]
    figures = {name: row[name] for name in BridgeFigures._fields if name in row}
    bridge = BridgeFigures(off_state=off_state, **figures)
    rest = {name: column for name, column in row.items() if name not in figures}
    return MotorDriverFacts(**rest | halves | {"bridge": bridge})


_ROWS = parts.rows("motor_drivers")
MOTOR_DRIVERS = {name: _facts(row) for name, row in _ROWS.items() if "unsupported" not in row}


def driver_facts(driver: str) -> MotorDriverFacts:
    """The facts of a driver of robot files; those of an L298N for `none`."""
    return MOTOR_DRIVERS.get(driver, MOTOR_DRIVERS["l298n"])


def driver_names(driver: str, side: str) -> DriverNames:
    """The names of the half that drives the `left` or `right` motor."""
    facts = driver_facts(driver)
    return facts.left if side == "left" else facts.right


def unknown_driver(written: str) -> UnsupportedPart:
    """What to write in place of `written`, which is no name of the table.

    A similar name is no reason to suggest a chip, because the next number may have other inputs: a
    DRV8838 has PWM and a direction, and a DRV8837 that is driven so turns its motor at rest.
    """
    cause = f"driver cannot be '{written}'"
    meant = _meant(written)
    if unsupported := [name for name in meant if name not in MOTOR_DRIVERS]:
        row = _ROWS[unsupported[0]]
        return UnsupportedPart(f"{cause}: {row['unsupported']}", row["fix"])
    if len(meant) == 1:
        inputs = MODE_TEXT[MOTOR_DRIVERS[meant[0]].mode]
        return UnsupportedPart(cause, f"did you mean {meant[0]}? It has {inputs}")
    cause += "; a driver with other inputs than its name states can turn the motors at rest"
    fix = "find its inputs in its data sheet, and write a driver that has the same"
    for mode, text in MODE_TEXT.items():
        same = [name for name in meant or MOTOR_DRIVERS if MOTOR_DRIVERS[name].mode == mode]
        fix += f". {text[0].upper()}{text[1:]}: {', '.join(same)}" if same else ""
    return UnsupportedPart(cause, fix)


def _meant(written: str) -> list[str]:
    """The rows that `written` names; with an unknown word, only those that no mode can drive."""
    known: dict[str, list[str]] = {}
    for row, facts in _ROWS.items():
        for name in (row, facts.get("title", row), *facts.get("other_names", ())):
            known.setdefault("".join(_words(name)), []).append(row)
    words, rows, has_unknown = _words(written), dict[str, None](), False
    while words:
        count, named = _named_first(words, known)
        rows |= dict.fromkeys(named)
        has_unknown = has_unknown or not (named or BESIDE.fullmatch(words[0]))
        words = words[count:]
    return [row for row in rows if not (has_unknown and row in MOTOR_DRIVERS)]


def _named_first(words: list[str], known: dict[str, list[str]]) -> tuple[int, list[str]]:
    """How many of the first words are a name, with the letters of a package, and its rows."""
    for count in range(len(words), 0, -1):
        before, last = "".join(words[: count - 1]), words[count - 1]
        for length in range(len(last), 0, -1):
            name, package = before + last[:length], last[length:]
            if name in known and re.fullmatch("[a-z]{0,3}", package):
                return count, known[name]
    return 1, []


def _words(name: str) -> list[str]:
    words = re.findall(r"[a-z0-9]+", name.lower()[:80])
    return [word for word in words if not HARMLESS.fullmatch(word)] or words
