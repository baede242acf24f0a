"""`calibrate battery`: the divider before the board's pin, and when the battery counts as low."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from math import hypot
from statistics import fmean, stdev
from typing import Any, NamedTuple

from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import Event, Message, Outcome, Running
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Battery as Told
from diffbotctl.prompts.question import Question

LISTEN_TIME_S = 10.0  # s: the board tells its battery every second or two
METER_SD_RATIO = 0.005  # of the reading, standard deviation: what a cheap multimeter promises
CONVERTER_SD_V = 5.0 / 1023 / 12**0.5  # V at the pin, standard deviation: the converter's step
PIN_MAX_V = 4.9  # V at the pin; the converter reads 5 V and all above it alike
BATTERY_MIN_V, BATTERY_MAX_V = 3.0, 30.0  # V of a supply that drives motors of this kind
UNKNOWN = "unknown"


class Chemistry(NamedTuple):
    """One cell, under the load of driving."""

    low: float
    """V below which little is left, or the cell takes harm"""
    full: float
    """V of a full cell at rest, just off the charger"""
    harm: bool
    """whether a cell that is emptied further takes harm"""


# The usual limits of makers' data sheets; a resting cell shows a tenth of a volt more.
CHEMISTRIES = {
    "lipo": Chemistry(3.3, 4.25, True),
    "li-ion": Chemistry(3.1, 4.25, True),
    "lifepo4": Chemistry(2.8, 3.65, True),
    "nimh": Chemistry(1.0, 1.5, True),
    "lead": Chemistry(1.85, 2.4, True),
    "alkaline": Chemistry(0.9, 1.65, False),
}


@dataclass(frozen=True, slots=True)
class BatteryStep:
    """The step."""

    seconds: float = LISTEN_TIME_S
    name: str = "battery"
    title: str = "the battery's divider, by a meter, and its low limit"
    lifted: bool = False

    def run(self, rig: RobotSession) -> Running:
        """Have the battery measured while the board does, and ask what kind it is."""
        rig.meet()
        found: list[Finding] = []
        lines: list[str] = []
        volts: float | None = None
        battery = rig.file.robot.battery
        if battery.pin is None:
            lines.append(
                "the board does not measure its battery: lead it through a divider to a free "
                "analog pin, and write `battery: {pin: A1, divider: 3}`"
            )
        else:
            yield Message("Nothing moves. Hold a meter to the battery's terminals.")
            told = self._told(rig)
            volts = float((yield METER_QUESTION))
            found.append(divider_finding(told, volts, battery.divider or 1.0))
            lines.append(
                f"divider {found[0].value:.4g}: {volts:.2f} V by the meter, "
                f"{fmean(told):.2f} V by the board until now"
            )
        low = yield from _low_limit(volts)
        if low is not None:
            found.append(low)
            lines.append(f"below {low.value:.3g} V under load it counts as low")
        return Outcome("battery", found, lines, volts=volts)

    def _told(self, rig: RobotSession) -> list[float]:
        """What the board says of the battery, with the divider that it was told."""
        heard = rig.listen(self.seconds).of(Told)
        if not heard:
            cause = f"the board said nothing of its battery in {self.seconds:g} s"
            fix = "is `battery.pin` the pin, and does the firmware know of it? Flash it anew"
            raise RunError(Problem("E-CALIBRATE-ROBOT", "battery", cause, fix))
        return [each.volts for each in heard]


METER_QUESTION = Question(
    "battery.volts",
    "What does the meter say?",
    unit="V",
    written="V",
    least=BATTERY_MIN_V,
    most=BATTERY_MAX_V,
    why="no battery of such a robot is there; measure at its terminals, robot switched on",
    quantity="battery",
)


def divider_finding(told: list[float], meter: float, used: float) -> Finding:
    """Battery volts per volt at the pin, from what the board told (V, by the divider `used`).

    Raises RunError where the pin is not connected, or sees more than it can read.
    """
    pin = fmean(told) / used
    if pin < 0.1 or pin > PIN_MAX_V:  # V
        side = (
            "nothing arrives: is it connected?"
            if pin < 1.0
            else "it sees 5 V or more: its "
            "resistors are too small or exchanged, and the pin may already be damaged"
        )
        cause = f"{pin:.2f} V at the pin while the battery has {meter:.2f} V; {side}"
        raise RunError(Problem("E-CALIBRATE-ROBOT", "battery.pin", cause, "look at the divider"))
    scatter = stdev(told) / used / len(told) ** 0.5 if len(told) > 1 else 0.0
    ratio = meter / pin
    return Finding(
        "battery.divider", ratio, ratio * hypot(METER_SD_RATIO, max(scatter, CONVERTER_SD_V) / pin)
    )


def _low_limit(volts: float | None) -> Generator[Event, Any, Finding | None]:
    kind = yield Question(
        "battery.chemistry",
        "What kind of cells are they? Enter: you do not know",
        choices=(*CHEMISTRIES, UNKNOWN),
        default=UNKNOWN,
    )
    if kind == UNKNOWN:
        return None
    cell = CHEMISTRIES[str(kind)]
    # So many cells, that none of them is fuller than full and the robot still runs.
    least, most = (1, 24) if volts is None else cell_range(volts, cell)
    asked = Question(
        "battery.cells",
        "How many cells in a row?",
        unit="1",
        least=least,
        most=most,
        why=f"{kind} cells have {cell.low:g} to {cell.full:g} V each"
        + ("" if volts is None else f", and the meter said {volts:.2f} V"),
    )
    cells = round(float((yield asked)))
    return Finding("battery.low", cells * cell.low)


def cell_range(volts: float, cell: Chemistry) -> tuple[int, int]:
    """How few and how many cells in a row can have `volts`."""
    empty = 0.75 * cell.low  # a battery that was forgotten, but still turns a motor
    least = int(-(-volts // cell.full))
    return least, max(least, int(volts / empty))
