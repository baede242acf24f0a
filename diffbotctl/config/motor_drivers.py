"""Motor drivers: inputs, supply, electrical figures and printed names of the pins.

The figures are typical ones of the data sheet named by `source`. Voltages are those of the motor
supply, currents continuous ones of one motor. Only the checks, the wiring and the plant read them:
what an estimator knows of a robot is measured on it.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

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
    """One type of driver board for two motors."""

    title: str
    mode: DriverMode
    supply: tuple[float, float]  # V, motor supply
    bridge: BridgeFigures
    left: DriverNames
    right: DriverNames
    supply_pin: str = "VM"
    logic_pin: str | None = None  # supplied with 5 V by the board
    standby: str | None = None
    always_high: str | None = None  # an input that has to be connected to the board's logic supply
    always_brakes: bool = False  # at duty 0 the outputs short the motor

    @property
    def with_article(self) -> str:
        """Its title after the indefinite article."""
        return f"{'an' if self.title.startswith('L') else 'a'} {self.title}"

    @property
    def current(self) -> float:
        """Continuous current (A) of one motor."""
        return self.bridge.current

    def inputs(self) -> tuple[str, ...]:
        """The pins of a motor in the robot file that the driver has."""
        return MOTOR_INPUTS[self.mode]


def _letters(*names: str | None) -> tuple[DriverNames, DriverNames]:
    """Names in which # stands for A or B."""
    sides = ([n and n.replace("#", letter) for n in names] for letter in "AB")
    left, right = (DriverNames(*side) for side in sides)  # type: ignore[arg-type]
    return left, right


_BRIDGES = {
    "l298n": BridgeFigures(
        2.0,
        1.4,
        1.15,
        "open",
        True,
        "ST L298: saturation voltages 1.35 + 1.2 V at 1 A, 2.0 + 1.7 V at 2 A",
    ),
    "tb6612": BridgeFigures(
        1.2, 0.0, 0.5, "shorted", True, "Toshiba TB6612FNG: 0.5 ohm, upper and lower"
    ),
    "drv8833": BridgeFigures(1.5, 0.0, 0.36, "open", True, "TI DRV8833: 200 + 160 mohm"),
    "tc1508s": BridgeFigures(
        1.5,
        0.0,
        1.6,
        "open",
        True,
        "1.6 ohm is that of the TC118S, one such bridge; the TC1508S's sheet was not seen",
    ),
    "l9110": BridgeFigures(
        0.8,
        1.1,
        1.0,
        "shorted",
        False,
        "L9110: 1.4 + 0.45 V at 0.75 A; split into two terms by estimate",
    ),
    "bts7960": BridgeFigures(
        20.0,
        0.0,
        0.016,
        "shorted",
        True,
        "Infineon BTS7960: path resistance 16 mohm; 20 A is the module's heat sink, not the chip",
    ),
    "drv8835": BridgeFigures(
        1.2, 0.0, 0.305, "shorted", True, "TI DRV8835: 305 mohm, upper and lower"
    ),
    "drv8838": BridgeFigures(
        1.7, 0.0, 0.28, "shorted", True, "TI DRV8838: 280 mohm, upper and lower"
    ),
    "cytron": BridgeFigures(
        10.0,
        0.0,
        0.02,
        "shorted",
        False,
        "Cytron MDD10A: 10 A; its sheet states no resistance, 20 mohm is an estimate",
    ),
}
_L298N = (
    DriverNames("ENA", "IN1", "IN2", "OUT1", "OUT2"),
    DriverNames("ENB", "IN3", "IN4", "OUT3", "OUT4"),
)
_FOUR_INPUTS = (
    DriverNames(None, "IN1", "IN2", "OUT1", "OUT2"),
    DriverNames(None, "IN3", "IN4", "OUT3", "OUT4"),
)
_PHASE = _letters("#ENABLE", "#PHASE", None, "#OUT1", "#OUT2")
MOTOR_DRIVERS = {
    "l298n": MotorDriverFacts(
        "L298N", "enable_in1_in2", (5.0, 35.0), _BRIDGES["l298n"], *_L298N, supply_pin="12V"
    ),
    "tb6612": MotorDriverFacts(
        "TB6612",
        "enable_in1_in2",
        (4.5, 13.5),
        _BRIDGES["tb6612"],
        *_letters("PWM#", "#IN1", "#IN2", "#O1", "#O2"),
        logic_pin="VCC",
        standby="STBY",
    ),
    "drv8833": MotorDriverFacts(
        "DRV8833",
        "two_pwm",
        (2.7, 10.8),
        _BRIDGES["drv8833"],
        *_letters(None, "#IN1", "#IN2", "#OUT1", "#OUT2"),
        always_high="nSLEEP",
    ),
    "tc1508s": MotorDriverFacts(
        "TC1508S", "two_pwm", (2.2, 9.6), _BRIDGES["tc1508s"], *_FOUR_INPUTS
    ),
    "l9110": MotorDriverFacts(
        "L9110",
        "two_pwm",
        (2.5, 12.0),
        _BRIDGES["l9110"],
        *_letters(None, "#-IA", "#-IB", "#-OA", "#-OB"),
        supply_pin="VCC",
        always_brakes=True,
    ),
    "bts7960": MotorDriverFacts(
        "BTS7960",
        "two_pwm",
        (5.5, 27.0),
        _BRIDGES["bts7960"],
        *_letters(None, "# RPWM", "# LPWM", "# M+", "# M-"),
        supply_pin="B+",
        logic_pin="VCC",
        always_high="R_EN, L_EN",
        always_brakes=True,
    ),
    "drv8835": MotorDriverFacts(
        "DRV8835",
        "enable_direction",
        (2.0, 11.0),
        _BRIDGES["drv8835"],
        *_PHASE,
        supply_pin="VIN",
        logic_pin="VCC",
        always_high="MODE",
        always_brakes=True,
    ),
    "drv8838": MotorDriverFacts(
        "DRV8838",
        "enable_direction",
        (2.0, 11.0),
        _BRIDGES["drv8838"],
        *_letters("# ENABLE", "# PHASE", None, "# OUT1", "# OUT2"),
        supply_pin="VIN",
        logic_pin="VCC",
        always_brakes=True,
    ),
    "cytron": MotorDriverFacts(
        "Cytron MDD10A",
        "enable_direction",
        (5.0, 30.0),
        _BRIDGES["cytron"],
        *_letters("PWM#", "DIR#", None, "M#A", "M#B"),
        supply_pin="VB+",
        always_brakes=True,
    ),
}


def driver_facts(driver: str) -> MotorDriverFacts:
    """The facts of a driver of robot files; those of an L298N for `none`."""
    return MOTOR_DRIVERS.get(driver, MOTOR_DRIVERS["l298n"])


def driver_names(driver: str, side: str) -> DriverNames:
    """The names of the half that drives the `left` or `right` motor."""
    facts = driver_facts(driver)
    return facts.left if side == "left" else facts.right
