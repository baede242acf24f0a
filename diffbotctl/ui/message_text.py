"""What a picture says, in words: one wording for live views and plain lines."""

from __future__ import annotations

from math import degrees

from diffbotctl.messages import (
    Goal,
    GoalState,
    Link,
    LogLine,
    Message,
    Odometry,
    Range,
    Stop,
    Wheels,
)
from diffbotctl.processes.screen import RunSnapshot


def newest(picture: RunSnapshot, kind: type) -> Message | None:
    """The newest message of class `kind` in the picture, whatever wire it is on."""
    found = [message for message in picture.messages.values() if type(message) is kind]
    return max(found, key=lambda message: message.time) if found else None


def located(picture: RunSnapshot) -> Odometry | None:
    """Where the robot is: as a block reckons it, in odom; only where none does, as a camera sees it
    from above, in the world's frame."""
    found = [(wire, said) for wire, said in picture.messages.items() if isinstance(said, Odometry)]
    reckoned = [said for wire, said in found if not wire.startswith("robot.")]
    seen = reckoned or [said for _, said in found]
    return max(seen, key=lambda message: message.time) if seen else None


def pose(odometry: Odometry) -> str:
    """`x 0.512 m  y 0.250 m  heading 45.2 deg`."""
    return (
        f"x {odometry.x:.3f} m  y {odometry.y:.3f} m  heading {degrees(odometry.heading):.1f} deg"
    )


def goal(number: int, goals: int, wanted: Goal) -> str:
    """`1 of 2: x 1.000 m  y 0.500 m  heading 90 deg`."""
    heading = "" if wanted.heading is None else f"  heading {degrees(wanted.heading):.0f} deg"
    return f"{number} of {goals}: x {wanted.x:.3f} m  y {wanted.y:.3f} m{heading}"


def goal_state(state: GoalState) -> str:
    """`driving, 0.42 m and 3.1 deg to go`."""
    left = f"{state.distance:.3f} m and {degrees(state.turn):.1f} deg to go"
    return f"{state.state.replace('_', ' ')}, {left}" + (f": {state.cause}" if state.cause else "")


def speeds(wheels: Wheels, odometry: Odometry | None) -> str:
    """Commanded wheel speeds, and the body's speed as measured."""
    wanted = f"{wheels.left:+.2f} {wheels.right:+.2f} rad/s"
    if odometry is None:
        return f"commanded {wanted}"
    return f"commanded {wanted}  body {odometry.linear:+.3f} m/s {odometry.angular:+.2f} rad/s"


def distance(reading: Range) -> str:
    """`0.213 m`, or why there is none."""
    if reading.state == "measured":
        return f"{reading.distance:.3f} m"
    return {"clear": "clear", "too_close": "too close", "fault": "FAULT"}[reading.state]


def link(said: Link) -> str:
    """`up, 412 frames, 3 damaged, 0 lost`."""
    counts = f"{said.received} frames, {said.damaged} damaged, {said.lost} lost"
    why = f" ({said.cause})" if said.cause else ""
    return f"{said.state}{why}, {counts}"


def line(said: LogLine) -> str:
    """`    2.78 s  WARNING  guard: STOP obstacle: ...`; the level stands there when it matters."""
    level = f"{said.level.upper()}  " if said.level in LOUD else ""
    text = "".join(each if each.isprintable() else " " for each in said.text)
    return f"{said.time / 1e9:8.2f} s  {level}{said.source}: {text}"


LOUD = ("warning", "error")
STYLES = {"debug": "dim", "warning": "yellow", "error": "bold red"}  # of a line, by its level


def stop(said: Stop | None) -> str:
    """What holds the robot, and how it may go on."""
    if said is None or not said.code:
        return "none"
    way_out = "; waits for `resume`" if said.latched else "; ends by itself"
    return f"{said.code}: {said.cause}{way_out}"


def holding(picture: RunSnapshot) -> Stop | None:
    """The gravest stop in force."""
    stops = [m for m in picture.messages.values() if isinstance(m, Stop) and m.code]
    return min(stops, key=lambda stop: not stop.latched) if stops else None
