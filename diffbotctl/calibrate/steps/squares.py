"""`calibrate geometry` with squares: UMBmark, driven by the robot and measured by a person.

Source of the procedure: Borenstein & Feng 1996, see umbmark.py.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import partial
from math import degrees, isnan, nan, pi, radians, sqrt
from typing import Any, Literal

from diffbotctl.calibrate import umbmark
from diffbotctl.calibrate.autonomous_drive import Waypoint, drive_to
from diffbotctl.calibrate.contradiction import ask_checked
from diffbotctl.calibrate.dead_reckoning import EndError, Geometry
from diffbotctl.calibrate.end_answers import (
    FACING,
    ZeroReadings,
    angle_contradiction,
    ask_place,
    place_contradiction,
    place_text,
    position_question,
)
from diffbotctl.calibrate.known_lengths import is_scale_measured, known_scale_sd, with_scale
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, SLIP, TRACK, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.square_ends import END_PLACES, SquareEnd, end_place, square_errors
from diffbotctl.calibrate.step import (
    Event,
    Message,
    Outcome,
    ScatterPlot,
    StepProgress,
    StepRun,
    marked_motion,
)
from diffbotctl.calibrate.umbmark import SquareErrors, SquaresFit
from diffbotctl.config.robot import Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Odometry
from diffbotctl.prompts.question import ExpectedQuestion, MarkFloor, MotionNotice, floor_drives
from diffbotctl.render.svg import end_error_svg

RUNS_PER_DIRECTION = 5
SLIP_USABLE = 0.05  # m; `drive.slip` is less
REACH_RATIO = sqrt(2.0) + 0.25  # of the side: the diagonal, and a margin for a wrong geometry
MM = 1000.0
CLOCKWISE, COUNTER = "clockwise", "counter-clockwise"
ReadMode = Literal["places", "headings", "both"]

FIRST_HEADING_ERROR_MAX, HEADING_DIFFERENCE_MAX = radians(45), radians(15)


@dataclass(frozen=True, slots=True)
class SquaresStep:
    """The step: `runs` squares in each direction.

    `side` in m, 0 for the one that suits the track; `read`: what is measured at each end.
    """

    side: float = 0.0
    runs: int = RUNS_PER_DIRECTION
    rounds: int = 1
    read: ReadMode = "places"
    name: str = "geometry"
    title: str = "track and wheel ratio, from squares in both directions"
    lifted: bool = False

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """Place, heading or both of each end."""
        side, ends = self._side(robot), 2 * self.runs * self.rounds
        places = 0 if self.read == "headings" else ends
        return [
            *floor_drives(self.name, ends),
            ExpectedQuestion(position_question("forward", side), places),
            ExpectedQuestion(position_question("left", side), places),
            ExpectedQuestion(FACING, 0 if self.read == "places" else ends),
        ]

    def run(self, session: RobotSession) -> StepRun:
        """Drive the squares, have their ends measured, correct the geometry; in each round."""
        session.connect()
        side = self._side(session.file.robot)
        report: list[str] = []
        findings: list[Finding] = []
        pictures = {}
        before = session.file.robot
        rounds: list[tuple[Geometry, SquareErrors]] = []
        for number in range(1, self.rounds + 1):
            driven = yield from self._drive_squares(session, side)
            used = stated_geometry(session.file.robot)
            rounds.append((used, driven))
            result = _fit(rounds)
            findings = _findings(before, result)
            report += [*result.left_out, *_report(side, used, result)]
            plot = _end_plot(driven)
            pictures[f"ends-{number}.svg"] = end_error_svg(plot.title, plot.points)
            yield plot
            session.try_findings(findings)
        return Outcome("umbmark", findings, [*report, *scale_report(before)], pictures=pictures)

    def _side(self, robot: Robot) -> float:
        return self.side or umbmark.advised_side(robot.drive.track)

    def _drive_squares(
        self, session: RobotSession, side: float
    ) -> Generator[Event, Any, SquareErrors]:
        reach, beside = side * REACH_RATIO, max(map(max, END_PLACES)) * side * MM
        yield MotionNotice(
            self.name,
            f"The robot drives a square of {side:g} m, {self.runs} times clockwise and {self.runs} "
            f"times counter-clockwise, and stays within {reach:.2f} m of its start. It starts "
            "along the first side; a clockwise square is on its right. Each square ends at "
            f"another place, up to {beside:.0f} mm beside its start: the "
            "answers must follow, which shows wrong signs and units.",
            reach=reach,
        )
        ends: dict[str, list[SquareEnd]] = {CLOCKWISE: [], COUNTER: []}
        zeros = self._zero_readings()
        for direction, driven in ends.items():
            for number in range(self.runs):
                waypoints = corners(side, direction == CLOCKWISE, end_place(number, side))
                yield StepProgress(f"squares {direction}", number, self.runs)
                mark = MarkFloor(
                    f"Square {number + 1} of {self.runs}, {direction}: put the robot at the start, "
                    "with its front along the first side. Mark the floor beside both tyres.",
                    f"it drives a square of {side:g} m, {direction}",
                )
                drive = partial(drive_to, session, waypoints, reach)
                odometry = yield from marked_motion(session, mark, drive)
                driven.append((yield from self._end(side, odometry, driven, zeros)))
        return square_errors(side, ends[CLOCKWISE], ends[COUNTER])

    def _zero_readings(self) -> tuple[ZeroReadings, ZeroReadings]:
        """Of the places and the headings."""
        planned = 2 * self.runs
        return (
            ZeroReadings(planned, "the end of a square, in front of and left of the start mark,"),
            ZeroReadings(planned, "the heading at the end of a square", "heading"),
        )

    def _end(
        self,
        side: float,
        odometry: Odometry,
        before: Sequence[SquareEnd],
        zeros: tuple[ZeroReadings, ZeroReadings],
    ) -> Generator[Event, Any, SquareEnd]:
        """The measured end, in the frame of the start, with that of odometry.

        `before`: the squares before in this direction.
        """
        x = y = heading = nan
        places, headings = zeros
        errors = [end.error for end in before]
        if self.read != "headings":
            check = partial(place_contradiction, odometry=odometry, before=errors, side=side)
            x, y = yield from ask_place(side, check)
            places.add(x, y)
        if self.read != "places":
            angle_check = partial(
                angle_contradiction,
                expected=odometry.heading,
                before=[error.heading for error in errors],
                first_max=FIRST_HEADING_ERROR_MAX,
                other_max=HEADING_DIFFERENCE_MAX,
            )
            heading = yield from ask_checked(FACING, angle_check)
            headings.add(heading)
        if self.read != "headings":
            wheels = place_text((odometry.x, odometry.y))
            yield Message(f"by the wheels: {wheels}; measured: {place_text((x, y))}")
        here = EndError(odometry.x, odometry.y, odometry.heading)
        return SquareEnd(EndError(x, y, heading), here)


def _fit(rounds: Sequence[tuple[Geometry, SquareErrors]]) -> SquaresFit:
    """The geometry and slip of the squares. Raises RunError if there is none."""
    measured = "was each end measured from its own start mark, ahead and to the left with its sign"
    try:
        result = umbmark.fit_squares(rounds)
    except ValueError as error:
        fix = f"{measured}, in millimetres?"
        raise RunError(Problem("E-CALIBRATE-ROBOT", "geometry", str(error), fix)) from error
    if result.is_contradicting:
        cause = (
            "no track and no wheels explain the ends of both directions: the best ones leave an "
            f"error of {result.after * MM:.0f} mm"
        )
        fix = f"{measured}? Then run this step again"
        raise RunError(Problem("E-CALIBRATE-ROBOT", "geometry", cause, fix))
    if result.slip_sd is not None and result.slip >= SLIP_USABLE:
        cause = (
            "the ends of equal squares lie so far apart as if each wheel slipped by "
            f"{result.slip * MM:.0f} mm after 1 m"
        )
        fix = (
            "does a wheel turn on its shaft, and did every square start at the same marks? Then "
            "repeat it on the floor on which the robot will drive"
        )
        raise RunError(Problem("E-CALIBRATE-ROBOT", "geometry", cause, fix))
    return result


def corners(side: float, clockwise: bool, end: tuple[float, float] = (0.0, 0.0)) -> list[Waypoint]:
    """The square from the origin along x to `end`, with a turn on the spot at each corner."""
    turn = -1.0 if clockwise else 1.0
    return [
        (side, 0.0, turn * pi / 2),
        (side, turn * side, pi),
        (0.0, turn * side, -turn * pi / 2),
        (*end, 0.0),
    ]


def stated_geometry(robot: Robot) -> Geometry:
    drive = robot.drive
    return Geometry(drive.right.wheel.diameter, drive.left.wheel.diameter, drive.track)


def _findings(robot: Robot, result: SquaresFit) -> list[Finding]:
    """Both diameters, the track and the slip, with their standard deviations.

    Squares do not change the mean diameter, and determine the track in multiples of it.
    """
    geometry, scale_sd = result.geometry, known_scale_sd(robot)
    own_sds = {
        RIGHT_DIAMETER: (geometry.right, result.ratio_sd / 2),
        LEFT_DIAMETER: (geometry.left, result.ratio_sd / 2),
        TRACK: (geometry.track, result.track_sd),
    }
    findings = [
        Finding(field, float(length), *with_scale(length, own, scale_sd))
        for field, (length, own) in own_sds.items()
    ]
    if result.slip_sd is not None:
        findings.append(Finding(SLIP, result.slip, result.slip_sd))
    return findings


def scale_report(robot: Robot) -> list[str]:
    """A line if the mean diameter was not measured."""
    if is_scale_measured(robot):
        return []
    percent = 100 * known_scale_sd(robot)
    return [
        "The mean wheel diameter is unchanged and was not measured, so all lengths have a "
        f"common standard deviation of {percent:.0f} %. `diffbotctl calibrate distance` measures "
        "it with a tape."
    ]


def _end_plot(squares: SquareErrors) -> ScatterPlot:
    points: dict[str, list[tuple[float, float]]] = {CLOCKWISE: [], COUNTER: []}
    if squares.has_positions:
        ends = {CLOCKWISE: squares.clockwise, COUNTER: squares.counter}
        centres = [umbmark.mean_end(errors) for errors in ends.values()]
        points = {name: [(end.x, end.y) for end in errors] for name, errors in ends.items()}
        points["centres"] = [(centre.x, centre.y) for centre in centres]
    return ScatterPlot(
        f"end errors of squares of {squares.side:g} m (measured minus odometry), mm", points
    )


def _report(side: float, used: Geometry, result: SquaresFit) -> list[str]:
    new, angles = result.geometry, umbmark.angles_between(used, result.geometry, side)
    lines = [
        f"{'':<22} {'before':>12} {'now':>12} {'+- (95 %)':>11}",
        f"{'right wheel diameter':<22} {used.right * MM:>9.3f} mm {new.right * MM:>9.3f} mm",
        f"{'left wheel diameter':<22} {used.left * MM:>9.3f} mm {new.left * MM:>9.3f} mm",
        f"{'track':<22} {used.track * MM:>9.3f} mm {new.track * MM:>9.3f} mm "
        f"{2 * new.track * result.track_sd * MM:>8.3f} mm",
        f"{'E_d, right over left':<22} {used.ratio:>12.5f} {new.ratio:>12.5f} "
        f"{2 * result.ratio_sd:>11.5f}",
        f"E_b, track now over before: {new.track / used.track:.5f}",
        f"heading error: {degrees(angles.alpha):+.2f} deg per quarter turn, "
        f"{degrees(angles.beta):+.2f} deg per side of {side:g} m",
    ]
    if not isnan(result.before):
        lines.append(
            f"E_max,syst: {result.before * MM:.1f} mm before, {result.after * MM:.1f} mm predicted"
        )
    if result.slip_sd is not None:
        lines.append(
            f"slip of a wheel: {result.slip * MM:.2f} mm after 1 m, "
            f"+- {2 * result.slip_sd * MM:.2f} mm, from the scatter of equal squares"
        )
    return lines
