"""`calibrate range`: the curve of a distance sensor, from a ruler and a white card."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any

from diffbotctl.calibrate.contradiction import ATTEMPTS_MAX
from diffbotctl.calibrate.range_fit import (
    RULER_DISTANCES_M,
    RangeFit,
    RulerPoint,
    error_limit,
    find_misread,
    fit_curve,
)
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import (
    CurvePlot,
    Event,
    Message,
    Outcome,
    StepProgress,
    StepRun,
    counted,
)
from diffbotctl.config.checks.calibration import SD_RATIO_MAX
from diffbotctl.config.robot import Robot, board_sensors
from diffbotctl.errors import Problem, RunError, join_words
from diffbotctl.geometry.distance_sensors import is_analog, volts_at
from diffbotctl.messages import Volts
from diffbotctl.prompts.question import ExpectedQuestion, ManualAction, Question

SETTLING_TIME_S = 0.2  # readings from before the card stood still are discarded
LISTEN_TIME_S = 5.0  # 200 readings at 40 Hz reduce 10 mV of noise to 0.7 mV
READINGS_MIN = 20
STEADY_DEVIATIONS_MAX = 5.0  # between the halves of the readings; more, and the card has moved
STEADY_MIN_V = 0.005  # one step of the converter
BATTERY_LISTEN_TIME_S = 2.5  # a board that measures its battery reports it in this time
DISTANCE_MIN_M, DISTANCE_MAX_M = 0.03, 0.50  # outside, a point does not help the curve
REPEATS_MAX = 2  # of points that the others contradict
CURVE_POINTS = 57  # of the plot
CM, MM, MV = 100.0, 1000.0, 1000.0


@dataclass(frozen=True, slots=True)
class RangeStep:
    """The step, for one sensor (empty: the only one); `seconds` of readings at each distance."""

    sensor: str = ""
    seconds: float = LISTEN_TIME_S
    name: str = "range"
    title: str = "the curve of the distance sensor, with a ruler"
    lifted: bool = False

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """The distance at each place of the card; once more that of a misread point."""
        card = _card_action(self.sensor, RULER_DISTANCES_M[0])
        questions = [_question(name, "") for name in ("range.distance", "range.repeated_distance")]
        return [
            ExpectedQuestion(questions[0], len(RULER_DISTANCES_M)),
            ExpectedQuestion(questions[1], 0),
            ExpectedQuestion(card),
        ]

    def run(self, session: RobotSession) -> StepRun:
        """Have a card put at each distance, average the voltages, fit the curve."""
        sensor = self._sensor(session.file.robot)
        session.connect()
        yield Message(
            "Nothing moves. Lay a ruler straight ahead from the front of the sensor "
            f"'{sensor}'. Put a white card, at least 15 cm wide, upright across it at each "
            "distance."
        )
        points: list[RulerPoint] = []
        for number, distance in enumerate(RULER_DISTANCES_M):
            yield StepProgress("distances", number, len(RULER_DISTANCES_M))
            points.append((yield from self._measure(session, sensor, distance)))
        fit = yield from self._fit(session, sensor, points)
        yield _curve_plot(sensor, fit)
        return Outcome(
            "range",
            _findings(sensor, fit),
            _report(sensor, fit),
            pictures={"points.csv": _points_table(fit)},
            volts=session.listen(BATTERY_LISTEN_TIME_S).battery_volts,
        )

    def _fit(
        self, session: RobotSession, sensor: str, points: list[RulerPoint]
    ) -> Generator[Event, Any, RangeFit]:
        """The curve. A point without which all others fit is measured again, once each.

        Raises RunError if no curve fits, or the point is no better then.
        """
        for repeat in range(REPEATS_MAX + 1):
            reason = ""
            try:
                fit = fit_curve(points)
            except ValueError as error:
                reason = str(error)
            else:
                if not fit.bad_points():
                    return fit
            misread = find_misread(points)
            if misread is None:
                if not reason and fit.sd[0] > SD_RATIO_MAX * fit.a:
                    reason = _unfit_points(fit)
                if reason:
                    raise _sensor_error(sensor, reason)
                return fit
            point, others = misread
            index = points.index(point)
            nominal = RULER_DISTANCES_M[index]
            cause = (
                f"without the point at {nominal * CM:g} cm the others fit, and by these the card "
                f"stood at {others.distance(point) * CM:.1f} cm, not at {point.distance * CM:g} cm"
            )
            if repeat == REPEATS_MAX:
                break
            yield Message(f"{cause[0].upper()}{cause[1:]}. Measure this point again.")
            points[index] = yield from self._measure(
                session, sensor, nominal, "range.repeated_distance"
            )
        raise _sensor_error(sensor, cause)

    def _sensor(self, robot: Robot) -> str:
        names = [name for name, sensor in board_sensors(robot).items() if is_analog(sensor.type)]
        if self.sensor in names or (not self.sensor and len(names) == 1):
            return self.sensor or names[0]
        if not names:
            cause = "the board reads no distance sensor with a voltage; others need no curve"
            fix = "add it under `sensors:`"
        else:
            cause = f"there is no sensor '{self.sensor}'" if self.sensor else "which sensor?"
            fix = f"give --sensor {join_words(names, 'or')}"
        raise RunError(Problem("E-CALIBRATE-RANGE", "sensors", cause, fix))

    def _measure(
        self, session: RobotSession, sensor: str, distance: float, name: str = "range.distance"
    ) -> Generator[Event, Any, RulerPoint]:
        text = f"{distance * CM:g} cm"
        yield _card_action(sensor, distance, name == "range.distance")
        question = _question(name, text)
        answer = yield question
        true = float(question.parse(answer) if isinstance(answer, str) else answer)
        for _ in range(ATTEMPTS_MAX):
            session.listen(SETTLING_TIME_S)
            messages = session.listen(self.seconds).of(Volts, f"robot.{sensor}")
            point = _steady_point(sensor, true, [message.volts for message in messages])
            if point is not None:
                noise = f"noise {point.noise * MV:.0f} mV"
                yield Message(f"{true * CM:.4g} cm: {point.volts:.3f} V, {noise}")
                return point
            yield Message("The voltage changed: hold the card still. Measuring again.")
        raise _sensor_error(sensor, f"the voltage at {text} is not steady")


def _card_action(sensor: str, distance: float, is_counted: bool = False) -> ManualAction:
    text = f"Put the card {distance * CM:g} cm from the sensor's front."
    if is_counted:
        text = counted(RULER_DISTANCES_M.index(distance), len(RULER_DISTANCES_M), text)
    return ManualAction("range.place", text, place=(sensor, distance))


def _steady_point(sensor: str, true: float, readings: list[float]) -> RulerPoint | None:
    """The mean of the readings; None if the card moved meanwhile. Raises RunError."""
    if len(readings) < READINGS_MIN:
        raise _sensor_error(sensor, f"the board sent only {len(readings)} readings")
    half = len(readings) // 2
    first, second = readings[:half], readings[half:]
    point = RulerPoint(true, fmean(readings), stdev(readings), len(readings))
    if point.volts <= 0.0:
        raise _sensor_error(sensor, "it reads 0 V: no supply, or a broken wire")
    sd = (stdev(first) ** 2 / half + stdev(second) ** 2 / len(second)) ** 0.5
    has_moved = abs(fmean(first) - fmean(second)) > max(STEADY_DEVIATIONS_MAX * sd, STEADY_MIN_V)
    return None if has_moved else point


def _unfit_points(fit: RangeFit) -> str:
    """Why a curve that leaves large errors is none."""
    errors = [
        f"{fit.error(point) * MM:+.0f} mm at {point.distance * CM:g} cm" for point in fit.points
    ]
    return (
        f"no curve of such a sensor fits these points; the nearest one misses {', '.join(errors)}"
    )


def _sensor_error(sensor: str, cause: str) -> RunError:
    fix = "check its three wires and the ruler, then run `diffbotctl calibrate range` again"
    return RunError(Problem("E-CALIBRATE-RANGE", f"sensors.{sensor}", cause, fix))


def _findings(sensor: str, fit: RangeFit) -> list[Finding]:
    """The three parameters of the curve, as the block `range_sensor` reads them."""
    return [
        Finding(f"sensors.{sensor}.curve.{name}", value, sd)
        for name, value, sd in zip("abc", (fit.a, fit.b, fit.c), fit.sd, strict=True)
    ]


def _points_table(fit: RangeFit) -> str:
    lines = [
        f"{point.distance:.5f},{point.volts:.5f},{point.noise:.5f},{point.readings}"
        for point in fit.points
    ]
    return "\n".join(["distance,volts,noise,readings", *lines]) + "\n"


def _report(sensor: str, fit: RangeFit) -> list[str]:
    """A table of the points, the curve, and advice."""
    bad = fit.bad_points()
    lines = ["  ruler     volts   noise    curve    error"]
    for point in fit.points:
        mark = "  beyond the limit" if point in bad else ""
        lines.append(
            f"{point.distance * CM:5.1f} cm {point.volts:7.3f} V {point.noise * MV:4.0f} mV "
            f"{fit.distance(point) * CM:5.1f} cm {fit.error(point) * MM:+6.1f} mm{mark}"
        )
    sign = "-" if fit.c < 0 else "+"
    lines += [
        f"{sensor}: volts = {fit.a:.4f} / (distance + {fit.b:.4f}) {sign} {abs(fit.c):.3f}; "
        f"noise of one reading {fit.noise * MV:.0f} mV",
        "Below 3 cm its voltage falls again, and 2 cm looks like 5 cm. Mount it at least 4 cm "
        "behind the front of the robot, so that no object can be nearer.",
    ]
    if bad:
        is_folded = bad[0].distance <= RULER_DISTANCES_M[0] + 0.01 and fit.error(bad[0]) > 0.0
        places = join_words([f"{point.distance * CM:g} cm" for point in bad], "and")
        suspect = (
            "the nearest card may have been closer than 3 cm"
            if is_folded
            else "the ruler, the card, or a shiny floor"
        )
        limit = f"{error_limit(0.1) * MM:.0f} mm or 2 %"
        lines.append(f"Error above {limit} at {places}: check {suspect}.")
    return lines


def _question(name: str, distance: str) -> Question:
    return Question(
        name,
        "Distance from the front of the sensor to the card?",
        unit="m",
        default_unit="cm",
        minimum=DISTANCE_MIN_M,
        maximum=DISTANCE_MAX_M,
        limit_reason="the sensor measures from 4 to 30 cm; is the unit cm?",
        quantity="gap",
        default=distance,
    )


def _curve_plot(sensor: str, fit: RangeFit) -> CurvePlot:
    near, far = fit.points[0].distance, fit.points[-1].distance
    steps = CURVE_POINTS - 1
    distances = [near + (far - near) * number / steps for number in range(CURVE_POINTS)]
    curve = [(distance * CM, volts_at(distance, fit.a, fit.b, fit.c)) for distance in distances]
    points = [(point.distance * CM, point.volts) for point in fit.points]
    return CurvePlot(
        f"{sensor}: the curve and its points", {"fit": curve, "ruler": points}, "cm", "V"
    )
