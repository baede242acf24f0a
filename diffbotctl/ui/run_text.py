"""What a picture says, in words: one wording for live views and plain lines.

Plain lines for a pipe or a file: the log, one line an event, never one a message.

The summary at the end of a run.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from math import degrees, hypot
from textwrap import wrap

from diffbotctl.messages import (
    Goal,
    GoalState,
    Link,
    LogLine,
    Message,
    Odometry,
    Range,
    Stop,
    Text,
    Wheels,
)
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.runs.run import RunResult


def newest_message(picture: RunSnapshot, kind: type) -> Message | None:
    """The newest message of class `kind` in the picture, whatever wire it is on."""
    found = [message for message in picture.messages.values() if type(message) is kind]
    return max(found, key=lambda message: message.time) if found else None


def newest_odometry(picture: RunSnapshot) -> Odometry | None:
    """Where the robot is: as a block reckons it, in odom; only where none does, as a camera sees it
    from above, in the world's frame."""
    found = [(wire, said) for wire, said in picture.messages.items() if isinstance(said, Odometry)]
    reckoned = [said for wire, said in found if not wire.startswith("robot.")]
    seen = reckoned or [said for _, said in found]
    return max(seen, key=lambda message: message.time) if seen else None


def pose_text(odometry: Odometry) -> str:
    """`x 0.512 m  y 0.250 m  heading 45.2 deg`."""
    return (
        f"x {odometry.x:.3f} m  y {odometry.y:.3f} m  heading {degrees(odometry.heading):.1f} deg"
    )


def goal_text(number: int, goals: int, wanted: Goal) -> str:
    """`1 of 2: x 1.000 m  y 0.500 m  heading 90 deg`."""
    heading = "" if wanted.heading is None else f"  heading {degrees(wanted.heading):.0f} deg"
    return f"{number} of {goals}: x {wanted.x:.3f} m  y {wanted.y:.3f} m{heading}"


def goal_state_text(state: GoalState) -> str:
    """`driving, 0.42 m and 3.1 deg to go`."""
    left = f"{state.distance:.3f} m and {degrees(state.turn):.1f} deg to go"
    return f"{state.state.replace('_', ' ')}, {left}" + (f": {state.cause}" if state.cause else "")


def wheel_speeds_text(wheels: Wheels, odometry: Odometry | None) -> str:
    """Commanded wheel speeds, and the body's speed as measured."""
    wanted = f"{wheels.left:+.2f} {wheels.right:+.2f} rad/s"
    if odometry is None:
        return f"commanded {wanted}"
    return f"commanded {wanted}  body {odometry.linear:+.3f} m/s {odometry.angular:+.2f} rad/s"


def range_text(reading: Range) -> str:
    """`0.213 m`, or why there is none."""
    if reading.state == "measured":
        return f"{reading.distance:.3f} m"
    return {"clear": "clear", "too_close": "too close", "fault": "FAULT"}[reading.state]


def link_text(said: Link) -> str:
    """`up, 412 frames, 3 damaged, 0 lost`."""
    counts = f"{said.received} frames, {said.damaged} damaged, {said.lost} lost"
    why = f" ({said.cause})" if said.cause else ""
    return f"{said.state}{why}, {counts}"


def log_line_text(said: LogLine) -> str:
    """`    2.78 s  WARNING  guard: STOP obstacle: ...`; the level stands there when it matters."""
    level = f"{said.level.upper()}  " if said.level in LEVELS_SHOWN else ""
    text = "".join(each if each.isprintable() else " " for each in said.text)
    return f"{said.time / 1e9:8.2f} s  {level}{said.source}: {text}"


LEVELS_SHOWN = ("warning", "error")
LOG_STYLES = {"debug": "dim", "warning": "yellow", "error": "bold red"}  # of a line, by its level


def stop_text(said: Stop | None) -> str:
    """What holds the robot, and how it may go on."""
    if said is None or not said.code:
        return "none"
    way_out = "; waits for `resume`" if said.latched else "; ends by itself"
    return f"{said.code}: {said.cause}{way_out}"


def active_stop(picture: RunSnapshot) -> Stop | None:
    """The gravest stop in force."""
    stops = [m for m in picture.messages.values() if isinstance(m, Stop) and m.code]
    return min(stops, key=lambda stop: not stop.latched) if stops else None


def log_lines(pictures: Iterator[RunSnapshot]) -> Iterator[str]:
    """The lines of the log, and the newest text of each wire that carries texts."""
    heard: dict[str, int] = {}
    for picture in pictures:
        yield from map(log_line_text, picture.lines)
        yield from _texts(picture, heard)


def _texts(picture: RunSnapshot, heard: dict[str, int]) -> Iterator[str]:
    """A line for each text of a block that is newer than the one `heard` on its wire."""
    for wire, message in picture.messages.items():
        if (
            isinstance(message, Text)
            and wire != BOARD_TEXT_WIRE
            and heard.get(wire, -1) < message.time
        ):
            heard[wire] = message.time
            yield f"{message.time / 1e9:8.2f} s  {wire}: {message.text}"


BOARD_TEXT_WIRE = "robot.text"  # what a board says stands in the log


def print_log(pictures: Iterator[RunSnapshot]) -> None:
    """Print lines to standard output as they come."""
    for text in log_lines(pictures):
        print(text, file=sys.stdout, flush=True)


WIDTH, MARGIN = 80, 12  # columns of the narrowest terminal in use, and of the names


def summary_lines(result: RunResult, last_goal: Goal | None) -> list[str]:
    """The summary as lines: a name, and what there is to say; long ones are folded."""
    made = []
    for name, text in summary_rows(result, last_goal):
        first, *more = wrap(text, WIDTH - MARGIN) or [""]
        made.append(f"{name:>{MARGIN - 1}} {first}")
        made += [" " * MARGIN + part for part in more]
    return made


def summary_rows(result: RunResult, last_goal: Goal | None) -> list[tuple[str, str]]:
    """The summary as (name, text)."""
    ending = result.ending
    found = [("ended", f"{ending.cause}, after {ending.time / 1e9:.1f} s")]
    if result.goals:
        found.append(("goals", f"{result.reached} of {result.goals} reached"))
    if result.odometry is not None:
        found.append(("pose", pose_text(result.odometry)))
    if last_goal is not None and result.odometry is not None:
        found.append(("error", _error(last_goal, result.odometry)))
    if last_goal is not None and result.truth is not None:
        found.append(("true error", _error(last_goal, result.truth.pose)))
    if result.odometry is not None:
        found.append(("path", f"{result.path:.2f} m"))
    found += [("stop", f"at {stop.time / 1e9:.1f} s, {stop_text(stop)}") for stop in result.stops]
    if result.link is not None:
        found.append(("link", link_text(result.link)))
    if ending.stopped is not None:
        confirmed = "confirmed" if ending.stopped else "NOT CONFIRMED: watch the wheels"
        found.append(("final stop", confirmed))
    if result.recording is not None:
        found.append(("recording", f"INCOMPLETE: {result.recording}"))
    if result.digest is not None:
        found.append(("digest", result.digest))
    return found


def _error(goal: Goal, pose: object) -> str:
    x, y, heading = pose.x, pose.y, pose.heading  # type: ignore[attr-defined]
    text = f"{hypot(goal.x - x, goal.y - y) * 1000:.1f} mm"
    if goal.heading is None:
        return text
    turn = (degrees(heading - goal.heading) + 180) % 360 - 180
    return f"{text}, {abs(turn):.1f} deg"
