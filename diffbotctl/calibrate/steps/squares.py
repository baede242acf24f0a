"""`calibrate geometry` by squares: UMBmark, driven by the robot itself, measured by a person.

Source of the procedure: Borenstein & Feng 1996, see umbmark.py.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from math import degrees, hypot, isnan, nan, pi, sqrt
from typing import Any

from diffbotctl.calibrate import autonomous_drive, umbmark
from diffbotctl.calibrate.dead_reckoning import EndError, Geometry
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, TRACK, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import (
    Event,
    MarkFloor,
    Message,
    MotionNotice,
    Outcome,
    Running,
    ScatterPlot,
    StepProgress,
)
from diffbotctl.calibrate.umbmark import UmbmarkResult
from diffbotctl.config.robot import Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Odometry
from diffbotctl.prompts.question import FACING, Question
from diffbotctl.render import end_error_svg
from diffbotctl.units import quantity

RUNS_PER_DIRECTION = 5  # squares each way round
DIAGONAL_RATIO = sqrt(2.0)  # of the side: how far the far corner is
REACH_MARGIN_RATIO = 0.25  # of the side: what a wrong geometry may add
MM = 1000.0
CLOCKWISE, COUNTER = "clockwise", "counter-clockwise"
READ_MODES = ("places", "headings", "both")


@dataclass(frozen=True, slots=True)
class SquaresStep:
    """The step: `runs` squares each way; `side` in m, 0 for the one that suits the track."""

    side: float = 0.0
    runs: int = RUNS_PER_DIRECTION
    rounds: int = 1
    read: str = "places"
    name: str = "geometry"
    title: str = "track and wheel ratio, by squares driven both ways round"
    lifted: bool = False

    def run(self, rig: RobotSession) -> Running:
        """Drive the squares, have their ends read, correct; as many rounds as wanted."""
        rig.meet()
        side = self.side or umbmark.advised_side(rig.file.robot.drive.track)
        report: list[str] = []
        findings: list[Finding] = []
        pictures = {}
        for number in range(self.rounds):
            ends = yield from self._round(rig, side)
            used = stated_geometry(rig)
            try:
                found = umbmark.fit_umbmark(ends, used, share=1 / (number + 1))
            except ValueError as error:
                raise _unusable_ends(str(error)) from error
            findings = umbmark_findings(rig.file.robot, found, side)
            report += _report(side, used, found)
            drawing = _end_plot(side, ends)
            pictures[f"ends-{number + 1}.svg"] = end_error_svg.ends(drawing.title, drawing.points)
            yield drawing
            rig.attempt(findings)
        return Outcome("umbmark", findings, report, pictures=pictures)

    def _round(self, rig: RobotSession, side: float) -> Generator[Event, Any, umbmark.SquareErrors]:
        reach = side * (DIAGONAL_RATIO + REACH_MARGIN_RATIO)
        yield MotionNotice(
            f"The robot drives a square of {side:g} m, {self.runs} times clockwise and {self.runs} "
            f"times counter-clockwise, and never further than {reach:.2f} m from its start. It "
            "begins along the first side; clockwise the square lies on its right.",
            reach=reach,
        )
        ways = []
        for way in (CLOCKWISE, COUNTER):
            ends = []
            for number in range(self.runs):
                yield StepProgress(f"squares {way}", number, self.runs)
                yield MarkFloor(
                    f"Square {number + 1} of {self.runs}, {way}: put the robot at the start, "
                    "looking along the first side; mark the floor beside both tyres."
                )
                end = autonomous_drive.drive_to(rig, corners(side, way == CLOCKWISE), reach)
                ends.append((yield from self._read(side, end)))
            ways.append(ends)
        read = umbmark.SquareErrors(side, ways[0], ways[1])
        if umbmark.squares_look_swapped(read):
            yield Message(SWAPPED)
            answer = yield Question(
                "geometry.swapped",
                "Take them the other way round?",
                choices=("yes", "no"),
                default="yes",
            )
            return read.exchanged() if answer == "yes" else read
        return read

    def _read(self, side: float, end: Odometry) -> Generator[Event, Any, EndError]:
        """The true end less the one of odometry, in the frame of the start."""
        x = y = heading = nan
        if self.read != "headings":
            x = float((yield _position_question("forward", side))) - end.x
            y = float((yield _position_question("left", side))) - end.y
        if self.read != "places":
            facing = yield FACING
            heading = wrap_angle(float(facing) - end.heading)
        return EndError(x, y, heading)


SWAPPED = (
    "These ends look as if clockwise and counter-clockwise had been exchanged: read the other way "
    "round, both of UMBmark's rules agree; as they are, they contradict each other."
)


def corners(side: float, clockwise: bool) -> list[autonomous_drive.Waypoint]:
    """The square from the origin along x, turning on the spot in each corner."""
    turn = -1.0 if clockwise else 1.0
    return [
        (side, 0.0, turn * pi / 2),
        (side, turn * side, pi),
        (0.0, turn * side, -turn * pi / 2),
        (0.0, 0.0, 0.0),
    ]


def wrap_angle(angle: float) -> float:
    """`angle` (rad) within half a turn of none."""
    return (angle + pi) % (2 * pi) - pi


def stated_geometry(rig: RobotSession) -> Geometry:
    """What odometry takes now."""
    drive = rig.file.robot.drive
    return Geometry(drive.right.wheel.diameter, drive.left.wheel.diameter, drive.track)


def umbmark_findings(robot: Robot, found: UmbmarkResult, side: float) -> list[Finding]:
    """Both diameters and the track; what the squares leave open of them.

    The mean diameter is as unsure as it was: squares say nothing of it.
    """
    geometry = found.geometry
    # A quarter turn misses alpha of pi/2; along a side beta turns it by b/L of the ratio.
    track_sd = geometry.track * found.sd.alpha / (pi / 2)
    ratio_sd = geometry.track / side * found.sd.beta
    right, left = (
        hypot(diameter * ratio_sd / 2, known_sd(robot, path))
        for diameter, path in ((geometry.right, RIGHT_DIAMETER), (geometry.left, LEFT_DIAMETER))
    )
    return [
        Finding(RIGHT_DIAMETER, geometry.right, right),
        Finding(LEFT_DIAMETER, geometry.left, left),
        Finding(TRACK, geometry.track, track_sd),
    ]


def known_sd(robot: Robot, path: str) -> float:
    """Standard deviation (m) that an earlier step gave to a length; 0 when none did."""
    entry = robot.calibration.get(path)
    return 0.0 if entry is None or entry.sd is None else quantity(str(entry.sd), "m")


POSITION_QUESTIONS = {
    "forward": "How far in front of the start mark did it end? Behind it is less than 0.",
    "left": "How far to the left of the start mark did it end? To the right is less than 0.",
}


def _position_question(which: str, side: float) -> Question:
    return Question(
        f"geometry.{which}",
        POSITION_QUESTIONS[which],
        unit="m",
        written="mm",
        least=-side,
        most=side,
        why="that is further off than the square is long",
        quantity=which,
    )


def _unusable_ends(cause: str) -> RunError:
    fix = "was every end read from the start mark, with its sign, in millimetres?"
    return RunError(Problem("E-CALIBRATE-ROBOT", "geometry", cause, fix))


def _end_plot(side: float, ends: umbmark.SquareErrors) -> ScatterPlot:
    points = {
        way: [(end.x, end.y) for end in many]
        for way, many in ((CLOCKWISE, ends.clockwise), (COUNTER, ends.counter))
    }
    if not ends.has_positions:
        points = {way: [] for way in points}
    else:
        points["centres"] = [
            (middle.x, middle.y)
            for middle in (umbmark.mean_end(ends.clockwise), umbmark.mean_end(ends.counter))
        ]
    return ScatterPlot(f"where squares of {side:g} m ended, less odometry, mm", points)


def _report(side: float, used: Geometry, found: UmbmarkResult) -> list[str]:
    new = found.geometry
    lines = [
        f"{'':<22} {'before':>12} {'found':>12} {'+- (95 %)':>11}",
        f"{'right wheel diameter':<22} {used.right * MM:>9.3f} mm {new.right * MM:>9.3f} mm",
        f"{'left wheel diameter':<22} {used.left * MM:>9.3f} mm {new.left * MM:>9.3f} mm",
        f"{'track':<22} {used.track * MM:>9.3f} mm {new.track * MM:>9.3f} mm "
        f"{2 * new.track * found.sd.alpha / (pi / 2) * MM:>8.3f} mm",
        f"{'Ed, right over left':<22} {used.ratio:>12.5f} {new.ratio:>12.5f} "
        f"{2 * new.track / side * found.sd.beta:>11.5f}",
        f"Eb, track found over before: {new.track / used.track:.5f}",
        f"each quarter turn missed {degrees(found.angles.alpha):+.2f} deg, each side of {side:g} m "
        f"gained {degrees(found.angles.beta):+.2f} deg",
    ]
    if not isnan(found.before):
        lines.append(
            f"E_max,syst: {found.before * MM:.1f} mm before, {found.after * MM:.1f} mm predicted "
            "from now on"
        )
    return lines
