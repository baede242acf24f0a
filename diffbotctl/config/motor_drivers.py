"""Motor drivers: inputs, supply, currents and printed names of the pins.

The figures are those by which the parts are usually described (ST L298; Toshiba TB6612FNG; TI
DRV8833, DRV8835, DRV8838; Infineon BTS7960; L9110S; TC1508S; Cytron MDD10A), rounded to the safe
side; they were not compared with the data sheets line by line. Voltages are those of the motor
supply, currents continuous ones of one motor.
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
    current: float  # A
    drop: float  # V at 1 A, both transistors
    left: DriverNames
    right: DriverNames
    supply_pin: str = "VM"
    logic_pin: str | None = None  # supplied with 5 V by the board
    standby: str | None = None
    always_brakes: bool = False  # at duty 0 the outputs short the motor

    @property
    def with_article(self) -> str:
        """Its title after the indefinite article."""
        return f"{'an' if self.title.startswith('L') else 'a'} {self.title}"

    def inputs(self) -> tuple[str, ...]:
        """The pins of a motor in the robot file that the driver has."""
        return MOTOR_INPUTS[self.mode]


def _letters(*names: str | None) -> tuple[DriverNames, DriverNames]:
    """Names in which # stands for A or B."""
    sides = ([n and n.replace("#", letter) for n in names] for letter in "AB")
    left, right = (DriverNames(*side) for side in sides)  # type: ignore[arg-type]
    return left, right


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
        "L298N", "enable_in1_in2", (5.0, 35.0), 2.0, 2.0, *_L298N, supply_pin="12V"
    ),
    "tb6612": MotorDriverFacts(
        "TB6612",
        "enable_in1_in2",
        (4.5, 13.5),
        1.2,
        0.5,
        *_letters("PWM#", "#IN1", "#IN2", "#O1", "#O2"),
        logic_pin="VCC",
        standby="STBY",
    ),
    "drv8833": MotorDriverFacts(
        "DRV8833",
        "two_pwm",
        (2.7, 10.8),
        1.5,
        0.4,
        *_letters(None, "#IN1", "#IN2", "#OUT1", "#OUT2"),
    ),
    "tc1508s": MotorDriverFacts("TC1508S", "two_pwm", (2.2, 9.6), 1.5, 0.5, *_FOUR_INPUTS),
    "l9110": MotorDriverFacts(
        "L9110",
        "two_pwm",
        (2.5, 12.0),
        0.8,
        1.5,
        *_letters(None, "#-IA", "#-IB", "#-OA", "#-OB"),
        supply_pin="VCC",
        always_brakes=True,
    ),
    "bts7960": MotorDriverFacts(
        "BTS7960",
        "two_pwm",
        (5.5, 27.0),
        20.0,
        0.1,
        *_letters(None, "# RPWM", "# LPWM", "# M+", "# M-"),
        supply_pin="B+",
        logic_pin="VCC",
        always_brakes=True,
    ),
    "drv8835": MotorDriverFacts(
        "DRV8835",
        "enable_direction",
        (2.0, 11.0),
        1.2,
        0.4,
        *_PHASE,
        supply_pin="VIN",
        logic_pin="VCC",
        always_brakes=True,
    ),
    "drv8838": MotorDriverFacts(
        "DRV8838",
        "enable_direction",
        (2.0, 11.0),
        1.7,
        0.3,
        *_letters("# ENABLE", "# PHASE", None, "# OUT1", "# OUT2"),
        supply_pin="VIN",
        logic_pin="VCC",
        always_brakes=True,
    ),
    "cytron": MotorDriverFacts(
        "Cytron MDD10A",
        "enable_direction",
        (5.0, 30.0),
        10.0,
        0.2,
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
