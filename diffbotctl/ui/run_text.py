"""A run as text: its newest messages, log lines and summary; one wording for all screens."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from math import ceil, degrees, hypot
from operator import itemgetter
from typing import NamedTuple, TypeVar

from diffbotctl.config.checks.calibration import uncalibrated_pose
from diffbotctl.config.robot import Robot
from diffbotctl.control.motion_profile import shortest_turn
from diffbotctl.control.pose_sd import PoseSd
from diffbotctl.engine.stop_places import stops_in_force
from diffbotctl.errors import WIDTH, join_words
from diffbotctl.estimation.geometry_deviation import may_have_wrong_slots
from diffbotctl.messages import (
    Duty,
    Goal,
    GoalState,
    Link,
    LogLine,
    MapPose,
    Message,
    Odometry,
    Range,
    Stop,
    Text,
    Wheels,
)
from diffbotctl.printable import fold_words
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.runs.options import RunResult
from diffbotctl.time import SECOND

M = TypeVar("M", bound=Message)
ROBOT_WIRES = "robot."  # prefix of the wires of the robot's driver
BOARD_TEXT_WIRE = "robot.text"  # texts of the board are in the log
LOG_STYLES = {"debug": "dim", "warning": "yellow", "error": "bold red"}  # of a line, by its level
NAME_WIDTH = 16  # columns of the names in the summary
GATE_WHEELS = "gate.wheels"
PERCENT = 100
LIMIT_SDS = 2.0  # standard deviations above the estimated error that an error is probably below
HALF_TURN_DEG = 180.0  # a larger error of the heading means that nothing is known of it


def newest_message(snapshot: RunSnapshot, kind: type[M]) -> M | None:
    """The newest message of class `kind` in the snapshot, on any wire."""
    messages = [message for message in snapshot.messages.values() if isinstance(message, kind)]
    return max(messages, key=lambda message: message.time, default=None)


def commanded_wheels(snapshot: RunSnapshot) -> Wheels | Duty | None:
    """What the gate sends to the wheels: after a stop, blocks before it may command otherwise."""
    message = snapshot.messages.get(GATE_WHEELS)
    return message if isinstance(message, Wheels | Duty) else newest_message(snapshot, Wheels)


def newest_odometry(snapshot: RunSnapshot) -> Odometry | None:
    """The robot's pose in odom as a block estimates it.

    Where no block does: as a camera measures it from above, in the frame of the world.
    """
    return max(_poses(snapshot).values(), key=lambda pose: pose.time, default=None)


def odometry_topic(snapshot: RunSnapshot) -> str | None:
    """The wire of `newest_odometry`."""
    poses = _poses(snapshot)
    return max(poses, key=lambda wire: poses[wire].time, default=None)


def _poses(snapshot: RunSnapshot) -> dict[str, Odometry]:
    poses = {wire: pose for wire, pose in snapshot.messages.items() if isinstance(pose, Odometry)}
    estimated = {wire: pose for wire, pose in poses.items() if not wire.startswith(ROBOT_WIRES)}
    return estimated or poses


def active_stop(snapshot: RunSnapshot) -> Stop | None:
    """The stop in force; a latched one before others."""
    return next((stop for _, stop in stops_in_force(snapshot.messages)), None)


def pose_text(odometry: Odometry) -> str:
    """`x 0.512 m  y 0.250 m  heading 45.2 deg`."""
    heading = degrees(odometry.heading)
    return f"x {odometry.x:z.3f} m  y {odometry.y:z.3f} m  heading {heading:z.1f} deg"


def pose_rows(snapshot: RunSnapshot) -> Iterator[tuple[str, str]]:
    """The pose by odometry, and that in the map, as (name, text)."""
    if (odometry := newest_odometry(snapshot)) is not None:
        yield "pose", pose_text(odometry)
    if (place := newest_message(snapshot, MapPose)) is not None:
        yield "map", map_pose_text(place)


def map_pose_text(pose: MapPose) -> str:
    """`mapping, x 0.512 m  y 0.250 m  heading 45.2 deg`; what is wrong instead, if it is."""
    place = f"x {pose.x:z.3f} m  y {pose.y:z.3f} m  heading {degrees(pose.heading):z.1f} deg"
    if pose.state == "ambiguous":
        return "several places look alike: click where the robot is, or `diffbotctl map place`"
    return f"{pose.state}, {pose.cause or place}"


def goal_text(goal: Goal, goals: int) -> str:
    """`1 of 2: x 1.000 m  y 0.500 m  heading 90 deg`."""
    heading = "" if goal.heading is None else f"  heading {degrees(goal.heading):z.0f} deg"
    return f"{goal.number} of {goals}: x {goal.x:z.3f} m  y {goal.y:z.3f} m{heading}"


def goal_state_text(state: GoalState) -> str:
    """`driving, 0.42 m and 3.1 deg to go`."""
    remaining = f"{state.distance:.3f} m and {degrees(state.turn):z.1f} deg to go"
    cause = f": {state.cause}" if state.cause else ""
    return f"{state.state.replace('_', ' ')}, {remaining}{cause}"


def wheel_speeds_text(wheels: Wheels | Duty, odometry: Odometry | None) -> str:
    """Commanded wheel speeds or duty, and the measured speed of the body."""
    commanded = f"commanded {wheels.left:+z.2f} {wheels.right:+z.2f} rad/s"
    if isinstance(wheels, Duty):
        commanded = f"commanded {wheels.left * PERCENT:+.0f} {wheels.right * PERCENT:+.0f} %"
    if odometry is None:
        return commanded
    return f"{commanded}  body {odometry.linear:+z.3f} m/s {odometry.angular:+z.2f} rad/s"


def range_text(reading: Range) -> str:
    """`0.213 m`, or why there is no distance."""
    match reading.state:
        case "measured":
            return f"{reading.distance:.3f} m"
        case "clear":
            return "clear"
        case "too_close":
            return "too close"
        case "fault":
            return "FAULT"


def link_text(link: Link) -> str:
    """`up, 412 frames, 3 damaged, 0 lost`."""
    cause = f" ({link.cause})" if link.cause else ""
    counts = f"{link.received} frames, {link.damaged} damaged, {link.lost} lost"
    return f"{link.state}{cause}, {counts}"


def stop_text(stop: Stop | None) -> str:
    if stop is None or not stop.code:
        return "none"
    end = "waits for `resume`" if stop.latched else "ends by itself"
    return f"{stop.code}: {stop.cause}; {end}"


def log_line_text(line: LogLine) -> str:
    """`    2.78 s  WARNING  guard: STOP obstacle: ...`; without the levels debug and info."""
    level = f"{line.level.upper()}  " if line.level in ("warning", "error") else ""
    text = "".join(character if character.isprintable() else " " for character in line.text)
    return f"{line.time / SECOND:8.2f} s  {level}{line.source}: {text}"


def log_lines(snapshots: Iterator[RunSnapshot]) -> Iterator[str]:
    """The lines of the log, and each new text of a wire that carries texts."""
    shown: dict[str, int] = {}  # time of the text shown last, by wire
    for snapshot in snapshots:
        lines = [(line.time, log_line_text(line)) for line in snapshot.lines]
        for wire, message in snapshot.messages.items():
            if not isinstance(message, Text) or wire == BOARD_TEXT_WIRE:
                continue
            if shown.get(wire, -1) < message.time:
                shown[wire] = message.time
                lines.append(
                    (message.time, f"{message.time / SECOND:8.2f} s  {wire}: {message.text}")
                )
        yield from (text for _, text in sorted(lines, key=itemgetter(0)))


def print_log(snapshots: Iterator[RunSnapshot]) -> None:
    """Print the lines to standard output as they come: for a pipe or a file."""
    for text in log_lines(snapshots):
        print(text, file=sys.stdout, flush=True)


def summary_lines(result: RunResult, robot: Robot | None, verbose: bool = False) -> list[str]:
    """The summary of a run as lines: names and values; long values are folded.

    `verbose`: with the errors as estimated.
    """
    lines = []
    for name, text in _summary(result, robot, verbose):
        first, *others = fold_words(text, WIDTH - NAME_WIDTH) or [""]
        lines.append(f"{name:>{NAME_WIDTH - 1}} {first}")
        lines += [" " * NAME_WIDTH + part for part in others]
    return lines


class PoseError(NamedTuple):
    """Distance of two poses, or a standard deviation, in m and rad. None: no heading was asked."""

    position: float
    heading: float | None = None

    @classmethod
    def of(cls, goal: Goal, x: float, y: float, heading: float) -> PoseError:
        """The error of a pose at `goal`."""
        distance = hypot(goal.x - x, goal.y - y)
        if goal.heading is None:
            return cls(distance)
        return cls(distance, abs(shortest_turn(heading - goal.heading)))

    def text(self) -> str:
        """`2.8 mm, 1.4 deg`."""
        turn = "" if self.heading is None else f", {degrees(self.heading):.1f} deg"
        return f"{self.position * 1000:.1f} mm{turn}"


class PoseErrors(NamedTuple):
    """How far the robot is from the goal at which its run ended; None where that is not known."""

    estimated_error: PoseError | None = None  # by odometry
    pose_sd: PoseError | None = None  # standard deviation of odometry, with that of the geometry
    actual_error: PoseError | None = None  # of a simulated robot

    @classmethod
    def of(cls, result: RunResult) -> PoseErrors:
        """Those of a run."""
        goal, pose, truth = result.goal, result.odometry, result.truth
        if goal is None or pose is None:
            return cls()
        sd = None
        if any(pose.covariance):  # it was computed from wheels
            sd = PoseError(*PoseSd.of(pose, counts_geometry=True))
        actual = None if truth is None else PoseError.of(goal, *truth.pose)
        return cls(PoseError.of(goal, pose.x, pose.y, pose.heading), sd, actual)

    def limit_text(self) -> str:
        """What the error probably is below: the estimated one and twice the standard deviation.

        Empty where none is known.
        """
        error, sd = self.estimated_error, self.pose_sd
        if error is None or sd is None or sd.heading is None:
            return ""
        position = error.position + LIMIT_SDS * sd.position
        length = f"{ceil(position * 100)} cm" if position < 1.0 else f"{position:.1f} m"
        if error.heading is None:
            return f"probably below {length}"
        turn = degrees(error.heading + LIMIT_SDS * sd.heading)
        heading = f" and {ceil(turn)} deg" if turn < HALF_TURN_DEG else "; heading not known"
        return f"probably below {length}{heading}"


def _summary(result: RunResult, robot: Robot | None, verbose: bool) -> Iterator[tuple[str, str]]:
    """The summary as (name, text)."""
    outcome, pose = result.ending, result.odometry
    yield "ended", f"{outcome.cause}, after {outcome.time / SECOND:.1f} s"
    if result.goals:
        unsure = f", {result.unsure} of them unsure" if result.unsure else ""
        yield "goals", f"{result.reached + result.unsure} of {result.goals} reached{unsure}"
    if pose is not None:
        yield "pose", pose_text(pose)
        yield from _error_summary(PoseErrors.of(result), pose, robot, verbose)
        yield "path", f"{result.path:.2f} m"
    for stop in result.stops:
        yield "stop", f"at {stop.time / SECOND:.1f} s, {stop_text(stop)}"
    if result.link is not None:
        yield "link", link_text(result.link)
    if outcome.stopped is not None:
        yield (
            "final stop",
            "confirmed" if outcome.stopped else "NOT CONFIRMED: watch the wheels",
        )
    if result.recording is not None:
        yield "recording", f"INCOMPLETE: {result.recording}"
    if result.log is not None:
        yield "log file", f"INCOMPLETE: {result.log}"
    if result.digest is not None:
        yield "digest", result.digest


def _error_summary(
    errors: PoseErrors, pose: Odometry, robot: Robot | None, verbose: bool
) -> Iterator[tuple[str, str]]:
    is_estimated = robot is None or robot.has_board  # otherwise the actual error is known
    if is_estimated and (limit := errors.limit_text()):
        is_open = robot is not None and may_have_wrong_slots(robot.calibration or {})
        yield "error", limit + " if `slots` is right" * is_open + _error_cause(pose, robot)
    if verbose and errors.estimated_error is not None:
        yield "estimated error", errors.estimated_error.text()
    if verbose and errors.pose_sd is not None:
        yield "pose sd", f"{errors.pose_sd.text()} (standard deviation)"
    if errors.actual_error is not None:
        yield "actual error", f"{errors.actual_error.text()} (simulation)"


def _error_cause(pose: Odometry, robot: Robot | None) -> str:
    """Why the error may be that large, and the command that makes it smaller."""
    if pose.warning:
        return f": {pose.warning}"
    sd = PoseSd.of(pose, counts_geometry=True)
    is_by_geometry = (
        2.0 * pose.geometry_sd**2 > sd.position**2
        or 2.0 * pose.geometry_heading_sd**2 > sd.heading**2
    )
    lacking = uncalibrated_pose(robot) if robot is not None and is_by_geometry else {}
    if not lacking:
        return ""
    calls = join_words([f"`diffbotctl calibrate {name}`" for name in lacking], "and")
    return f": {join_words(lacking.values(), 'and')} are not calibrated; run {calls}"
