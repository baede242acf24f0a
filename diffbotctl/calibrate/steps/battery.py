"""`calibrate battery`: the voltage divider in front of the board's pin, and the low limit."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import partial
from math import hypot
from statistics import fmean, stdev
from typing import Any, NamedTuple

from diffbotctl.calibrate.contradiction import ask_checked
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import Event, Message, Outcome, StepRun
from diffbotctl.config.robot import Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Battery
from diffbotctl.prompts.question import ExpectedQuestion, Question

LISTEN_TIME_S = 10.0  # the board reports its battery every second or two
METER_SD_RATIO = 0.005  # of the reading of a cheap multimeter
CONVERTER_SD_V = 5.0 / 1023 / 12**0.5  # at the pin, from the converter's step
PIN_MIN_V, PIN_MAX_V = 0.1, 4.9  # the converter reads every voltage above 5 V as 5 V
UNCONNECTED_PIN_V = 1.0  # an unusable pin below this is not connected, above it is overloaded
BATTERY_MIN_V, BATTERY_MAX_V = 3.0, 30.0  # for motors of this kind
# Resistors are within 5 %, the reference of the board's converter within 10 %.
DIVIDER_ERROR_MAX = 0.15
UNKNOWN = "unknown"

METER_QUESTION = Question(
    "battery.volts",
    "Voltage on the meter?",
    unit="V",
    default_unit="V",
    minimum=BATTERY_MIN_V,
    maximum=BATTERY_MAX_V,
    limit_reason="measure at the terminals of the battery, with the robot switched on",
    quantity="battery",
)


class Chemistry(NamedTuple):
    """One cell."""

    low: float  # V under the load of driving, below which it is nearly empty or takes damage
    full: float  # V of a fully charged cell at rest


# The usual limits of data sheets; at rest the voltage is about 0.1 V higher.
CHEMISTRIES = {
    "lipo": Chemistry(3.3, 4.25),
    "li-ion": Chemistry(3.1, 4.25),
    "lifepo4": Chemistry(2.8, 3.65),
    "nimh": Chemistry(1.0, 1.5),
    "lead": Chemistry(1.85, 2.4),
    "alkaline": Chemistry(0.9, 1.65),
}
CHEMISTRY_QUESTION = Question(
    "battery.chemistry",
    "Chemistry of the cells? Press Enter if you do not know",
    choices=(*CHEMISTRIES, UNKNOWN),
    default=UNKNOWN,
)


@dataclass(frozen=True, slots=True)
class BatteryStep:
    """The step."""

    seconds: float = LISTEN_TIME_S
    name: str = "battery"
    title: str = "the battery divider, with a meter, and the low limit"
    lifted: bool = False

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """The meter, the chemistry and the number of cells; nothing without a pin."""
        cells = Question("battery.cells", "", unit="1", is_whole=True)
        return [
            ExpectedQuestion(METER_QUESTION, 0 if robot.battery.pin is None else 1),
            ExpectedQuestion(CHEMISTRY_QUESTION, 0),
            ExpectedQuestion(cells, 0),
        ]

    def run(self, session: RobotSession) -> StepRun:
        """Have the battery measured while the board measures it, and ask for its chemistry."""
        session.connect()
        findings: list[Finding] = []
        lines: list[str] = []
        volts: float | None = None
        battery = session.file.robot.battery
        if battery.pin is None:
            lines.append(
                "the board does not measure its battery: connect it through a divider to a free "
                "analog pin, and add `battery: {pin: A1, divider: 3}`"
            )
            return Outcome("battery", findings, lines, is_recorded=False)
        yield Message("Nothing moves. Connect a meter to the terminals of the battery.")
        readings = self._readings(session)
        check = partial(_meter_contradiction, board=fmean(readings))
        volts = yield from ask_checked(METER_QUESTION, check)
        findings.append(divider_finding(readings, volts, battery.divider or 1.0))
        lines.append(
            f"divider {findings[0].value:.4g}: the meter shows {volts:.2f} V, the board "
            f"reported {fmean(readings):.2f} V"
        )
        low, line = yield from _low_limit(volts)
        findings += low
        lines += line
        return Outcome("battery", findings, lines, volts=volts)

    def _readings(self, session: RobotSession) -> list[float]:
        """The voltages (V) that the board reports, with the present divider."""
        messages = session.listen(self.seconds).of(Battery)
        if not messages:
            cause = f"the board did not report its battery in {self.seconds:g} s"
            fix = "is `battery.pin` correct? Then flash the firmware again"
            raise RunError(Problem("E-CALIBRATE-ROBOT", "battery", cause, fix))
        return [message.volts for message in messages]


def divider_finding(readings: Sequence[float], meter: float, divider: float) -> Finding:
    """Battery volts per volt at the pin.

    `readings` are the board's voltages (V) with the present `divider`, `meter` that of the meter.
    Raises RunError if the pin is not connected, or its voltage is too high for the converter.
    """
    pin = fmean(readings) / divider
    if not PIN_MIN_V <= pin <= PIN_MAX_V:
        reason = (
            "is it connected?"
            if pin < UNCONNECTED_PIN_V
            else "5 V or more: the resistors are wrong or exchanged, and the pin may be damaged"
        )
        cause = f"{pin:.2f} V at the pin while the battery has {meter:.2f} V; {reason}"
        raise RunError(Problem("E-CALIBRATE-ROBOT", "battery.pin", cause, "check the divider"))
    count = len(readings)
    pin_sd = stdev(readings) / divider / count**0.5 if count > 1 else 0.0
    ratio = meter / pin
    sd = ratio * hypot(METER_SD_RATIO, max(pin_sd, CONVERTER_SD_V) / pin)
    return Finding("battery.divider", ratio, sd)


def _meter_contradiction(meter: float, board: float) -> str | None:
    """Why the meter's voltage does not go with the one that the board reports (V)."""
    ratio = meter / board - 1 if board else 0.0
    if abs(ratio) <= DIVIDER_ERROR_MAX:
        return None
    return (
        f"The board reports {board:.2f} V with the divider of the robot file; {meter:.2f} V differ "
        f"from that by {100 * ratio:+.0f} %, more than its resistors can."
    )


def _low_limit(volts: float) -> Generator[Event, Any, tuple[list[Finding], list[str]]]:
    """The limit below which a battery of `volts` at rest is low, and a line about it."""
    kind = yield CHEMISTRY_QUESTION
    if kind == UNKNOWN:
        return [], []
    cell = CHEMISTRIES[str(kind)]
    minimum, maximum = cell_range(volts, cell)
    if maximum < minimum:
        text = (
            f"The low limit was not written: no number of {kind} cells, of {cell.low:g} to "
            f"{cell.full:g} V each, has {volts:.2f} V. Charge the battery, or correct the "
            "chemistry, and run this step again."
        )
        return [], [text]
    cells = yield Question(
        "battery.cells",
        "Number of cells in series?",
        unit="1",
        minimum=minimum,
        maximum=maximum,
        is_whole=True,
        limit_reason=f"{kind} cells have {cell.low:g} to {cell.full:g} V each, and the meter shows "
        f"{volts:.2f} V; charge an empty battery first",
    )
    low = round(float(cells)) * cell.low
    return [Finding("battery.low", low)], [f"low limit: {low:.3g} V under load"]


def cell_range(volts: float, cell: Chemistry) -> tuple[int, int]:
    """The minimum and maximum number of cells in series that have `volts` and are not empty.

    The maximum is below the minimum if there is no such number.
    """
    return -int(-volts // cell.full), int(volts / cell.low)
