"""`calibrate range`: the curve of a distance sensor, from a rule and something white."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any

from diffbotctl.blocks.range_sensor import volts_at
from diffbotctl.calibrate.range_fit import (
    RULER_DISTANCES_M,
    RangeFit,
    RulerPoint,
    error_limit,
    fit_curve,
)
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import (
    CurvePlot,
    Event,
    ManualAction,
    Message,
    Outcome,
    Running,
    StepProgress,
)
from diffbotctl.errors import Problem, RunError, join_words
from diffbotctl.messages import Battery, Volts
from diffbotctl.prompts.question import Question

SETTLING_TIME_S = 0.2  # s of readings that are thrown away: the hand, and what came before it
LISTEN_TIME_S = 5.0  # s of readings that are averaged: 200 at 40 Hz leave 0.7 mV of 10 mV noise
READINGS_MIN = 20
STEADY_DEVIATIONS_MAX = (
    5.0  # standard deviations between both halves of the readings: more, and it has moved
)
BATTERY_LISTEN_TIME_S = 2.5  # s; a board that measures its battery tells it meanwhile
ATTEMPTS_MAX = 3
DISTANCE_MIN_M, DISTANCE_MAX_M = 0.03, 0.50  # m; beyond, no point of the curve is worth anything
CM, MM, MV = 100.0, 1000.0, 1000.0
CURVE_POINTS = 57  # points of the curve in the picture


@dataclass(frozen=True, slots=True)
class RangeStep:
    """The step, for one sensor; `sensor` empty: the only one. `seconds` of readings a distance."""

    sensor: str = ""
    seconds: float = LISTEN_TIME_S
    name: str = "range"
    title: str = "the distance sensor's curve, by the rule"
    lifted: bool = False

    def run(self, rig: RobotSession) -> Running:
        """Have the rule's distances set in turn, average the volts, lay the curve through them."""
        sensor = self._sensor(rig)
        rig.meet()
        yield Message(
            f"Nothing moves. Lay a rule from the front of the sensor '{sensor}', straight ahead, "
            "and put a white card of at least 15 cm across it, upright, at each distance in turn."
        )
        points: list[RulerPoint] = []
        for number, distance in enumerate(RULER_DISTANCES_M):
            yield StepProgress("distance by distance", number, len(RULER_DISTANCES_M))
            points.append((yield from self._point(rig, sensor, distance)))
        found = self._fit(sensor, points)
        yield _curve_plot(sensor, found)
        told = rig.listen(BATTERY_LISTEN_TIME_S).of(Battery)
        return Outcome(
            "range",
            range_findings(sensor, found),
            range_report(sensor, found),
            pictures={"points.csv": points_table(found)},
            volts=told[-1].volts if told else None,
        )

    def _sensor(self, rig: RobotSession) -> str:
        names = list(rig.file.robot.sensors)
        if self.sensor in names or (not self.sensor and len(names) == 1):
            return self.sensor or names[0]
        if not names:
            cause, fix = "the robot file has no distance sensor", "write it under `sensors:`"
        else:
            cause = f"there is no sensor '{self.sensor}'" if self.sensor else "which sensor?"
            fix = f"say --sensor with one of {join_words(names, 'or')}"
        raise RunError(Problem("E-CALIBRATE-RANGE", "sensors", cause, fix))

    def _point(
        self, rig: RobotSession, sensor: str, distance: float
    ) -> Generator[Event, Any, RulerPoint]:
        shown = f"{distance * CM:g} cm"
        yield ManualAction(
            "range.place",
            f"Put the card {shown} from the sensor's front.",
            place=(sensor, distance),
        )
        question = _question(shown)
        answer = yield question
        true = float(question.read(answer) if isinstance(answer, str) else answer)
        for _ in range(ATTEMPTS_MAX):
            rig.listen(SETTLING_TIME_S)
            heard = rig.listen(self.seconds)
            readings = [each.volts for each in heard.of(Volts, f"robot.{sensor}")]
            point = self._believed(sensor, true, readings)
            if point is not None:
                yield Message(
                    f"{true * CM:.4g} cm: {point.volts:.3f} V, noise {point.noise * MV:.0f} mV"
                )
                return point
            yield Message("the voltage wandered off: hold the card still. Measured again")
        raise self._trouble(sensor, f"the voltage at {shown} does not stand still")

    def _believed(self, sensor: str, true: float, readings: list[float]) -> RulerPoint | None:
        """The point that readings make; None when the card has moved meanwhile."""
        if len(readings) < READINGS_MIN:
            raise self._trouble(sensor, f"the board sent {len(readings)} readings only")
        half = len(readings) // 2
        first, second = readings[:half], readings[half:]
        point = RulerPoint(true, fmean(readings), stdev(readings), len(readings))
        if point.volts <= 0.0:
            raise self._trouble(sensor, "it reads 0 V: no supply, or a broken wire")
        steady = (
            STEADY_DEVIATIONS_MAX
            * (stdev(first) ** 2 / half + stdev(second) ** 2 / len(second)) ** 0.5
        )
        moved = abs(fmean(first) - fmean(second)) > max(steady, 0.005)  # V: a step of the converter
        return None if moved else point

    def _fit(self, sensor: str, points: list[RulerPoint]) -> RangeFit:
        try:
            return fit_curve(points)
        except ValueError as error:
            raise self._trouble(sensor, str(error)) from error

    def _trouble(self, sensor: str, cause: str) -> RunError:
        fix = "look at its three wires and at the rule, then run `diffbotctl calibrate range` again"
        return RunError(Problem("E-CALIBRATE-RANGE", f"sensors.{sensor}", cause, fix))


def range_findings(sensor: str, found: RangeFit) -> list[Finding]:
    """The three numbers of the curve, where the block `range_sensor` reads them."""
    values = (found.a, found.b, found.c)
    return [
        Finding(f"sensors.{sensor}.curve.{name}", value, sd)
        for name, value, sd in zip("abc", values, found.sd, strict=True)
    ]


def points_table(found: RangeFit) -> str:
    """The points as CSV text, to be fitted again."""
    lines = [
        f"{each.distance:.5f},{each.volts:.5f},{each.noise:.5f},{each.readings}"
        for each in found.points
    ]
    return "\n".join(["distance,volts,noise,readings", *lines]) + "\n"


def range_report(sensor: str, found: RangeFit) -> list[str]:
    """A table of the points, and what a person should know of them."""
    lines = ["  rule      volts   noise     told    error"]
    for each in found.points:
        bad = "  more than asked" if each in found.misses() else ""
        lines.append(
            f"{each.distance * CM:5.1f} cm {each.volts:7.3f} V {each.noise * MV:4.0f} mV "
            f"{found.told(each) * CM:5.1f} cm {found.error(each) * MM:+6.1f} mm{bad}"
        )
    sign = "-" if found.c < 0 else "+"
    lines.append(
        f"{sensor}: volts = {found.a:.4f} / (distance + {found.b:.4f}) {sign} {abs(found.c):.3f}; "
        f"one reading scatters by {found.noise * MV:.0f} mV"
    )
    lines += _warnings(found)
    return lines


def _warnings(found: RangeFit) -> list[str]:
    lines = [
        "Nearer than 3 cm its voltage falls again, and 2 cm reads like 5 cm. Mount it 4 cm behind "
        "the robot's front, where nothing can come so near."
    ]
    missed = found.misses()
    if missed:
        near = missed[0].distance <= RULER_DISTANCES_M[0] + 0.01 and found.error(missed[0]) > 0.0
        places = join_words([f"{each.distance * CM:g} cm" for each in missed], "and")
        why = (
            "the nearest one may have stood in the fold, closer than 3 cm"
            if near
            else "the rule, the card, or a shiny floor between them"
        )
        lines.append(
            f"Told worse than {error_limit(0.1) * MM:.0f} mm or 2 %: {places}; suspect {why}."
        )
    return lines


def _question(shown: str) -> Question:
    return Question(
        "range.distance",
        f"How far from the sensor's front does the card stand? Enter: {shown}",
        unit="m",
        written="cm",
        least=DISTANCE_MIN_M,
        most=DISTANCE_MAX_M,
        why="the sensor measures from 4 to 30 cm; is it centimetres?",
        quantity="gap",
        default=shown,
    )


def _curve_plot(sensor: str, found: RangeFit) -> CurvePlot:
    near, far = found.points[0].distance, found.points[-1].distance
    places = [near + (far - near) * number / (CURVE_POINTS - 1) for number in range(CURVE_POINTS)]
    curve = [(each * CM, volts_at(each, found.a, found.b, found.c)) for each in places]
    points = [(each.distance * CM, each.volts) for each in found.points]
    return CurvePlot(
        f"{sensor}: the curve and its points", {"fit": curve, "by the rule": points}, "cm", "V"
    )
