"""The facts beside the map: pose, goal, wheels, range, supply, link and stop, a row each."""

from __future__ import annotations

from math import degrees, isfinite, pi, remainder

from rich.table import Table
from rich.text import Text

from diffbotctl.messages import Battery, Duty, Goal, GoalState, Link, Range, Wheels
from diffbotctl.messages import Text as Words
from diffbotctl.ui import words
from diffbotctl.ui.bar import bar, swing
from diffbotctl.ui.dash.sight import Sight


def facts(sight: Sight, width: int, plain: bool = False) -> Table:
    """Pose, goal, wheels, range, battery, link and stop, in `width` characters."""
    table = Table.grid(padding=(0, 1))
    table.add_column(style="bold", no_wrap=True, width=6)
    table.add_column(no_wrap=True, overflow="ellipsis", width=width - 7)
    for row in (*_pose(sight), *_goal(sight), *_wheels(sight, width - 7, plain)):
        table.add_row(*row)
    for row in (*_ranges(sight, width - 7, plain), *_battery(sight), *_link(sight), *_stop(sight)):
        table.add_row(*row)
    for wire, message in sight.picture.messages.items():
        if isinstance(message, Words):
            table.add_row(wire.partition(".")[0][:6], message.text)
    return table


Row = tuple[str | Text, str | Text]


def _pose(sight: Sight) -> list[Row]:
    said = words.located(sight.picture)
    if said is None:
        return []
    return [
        ("pose", f"{said.x:+.3f} {said.y:+.3f} m {degrees(remainder(said.heading, 2 * pi)):+.1f}°"),
        ("", f"{said.linear:+.3f} m/s {said.angular:+.2f} rad/s"),
    ]


def _goal(sight: Sight) -> list[Row]:
    goal, state = words.newest(sight.picture, Goal), words.newest(sight.picture, GoalState)
    rows: list[Row] = []
    if isinstance(goal, Goal) and goal.number:
        heading = "" if goal.heading is None else f" {degrees(goal.heading):+.1f}°"
        rows.append(("goal", f"{goal.x:+.3f} {goal.y:+.3f} m{heading}"))
    if isinstance(state, GoalState):
        style = {"reached": "green", "blocked": "red", "stuck": "red", "timed_out": "red"}
        said = Text(state.state.replace("_", " "), style.get(state.state, ""))
        if state.state not in ("idle", "reached"):
            said.append(f" {state.distance:.3f} m {degrees(state.turn):+.0f}°")
        rows.append(("" if rows else "goal", said))
        if state.cause:
            rows.append(("", Text(state.cause, "red")))
    return rows


def _wheels(sight: Sight, width: int, plain: bool) -> list[Row]:
    """Commanded above measured, for each wheel."""
    robot, odometry = sight.scene.robot, words.located(sight.picture)
    commanded = sight.picture.messages.get("gate.wheels") or words.newest(sight.picture, Wheels)
    if robot is None or not isinstance(commanded, Wheels | Duty):
        return []
    rows: list[Row] = []
    length = max(width - 8, 5)
    for side, sign, diameter in (
        ("left", -1, robot.left_diameter), ("right", 1, robot.right_diameter)
    ):  # fmt: skip
        most = 1.0 if isinstance(commanded, Duty) else robot.speed / (diameter / 2)
        wanted = getattr(commanded, side)
        rows.append((side, _speed(wanted, most, length, "magenta", plain)))
        if odometry is not None and isinstance(commanded, Wheels):
            speed = odometry.linear + sign * odometry.angular * robot.track / 2
            rows.append(("", _speed(speed / (diameter / 2), most, length, "cyan", plain)))
    return rows


def _speed(value: float, most: float, length: int, style: str, plain: bool) -> Text:
    return Text.assemble((swing(value / most, length, plain), style), f" {value:+6.2f}")


def _ranges(sight: Sight, width: int, plain: bool) -> list[Row]:
    rows: list[Row] = []
    beams = {beam.topic: beam.reach for beam in sight.scene.beams}
    for wire, message in sight.picture.messages.items():
        if isinstance(message, Range):
            reach = beams.get(wire, message.distance or 1.0)
            known = message.state in ("measured", "clear")
            share = message.distance / reach if known else 0.0
            style = "red" if message.state in ("too_close", "fault") else "yellow"
            told = Text.assemble((bar(share, max(width - 10, 4), plain), style))
            rows.append(("range", told.append(f" {words.distance(message)}")))
    return rows


def _battery(sight: Sight) -> list[Row]:
    said = words.newest(sight.picture, Battery)
    if not isinstance(said, Battery):
        return []
    return [("supply", Text(f"{said.volts:.1f} V", "red" if said.low else ""))]


def _link(sight: Sight) -> list[Row]:
    said = words.newest(sight.picture, Link)
    if not isinstance(said, Link):
        return []
    rate = max((row["rate"] for wire, row in sight.rates.items() if wire == "robot.encoders"),
               default=0.0)  # fmt: skip
    style = "" if said.state == "up" else "red"
    rows: list[Row] = [("link", Text(f"{said.state} {rate:.0f} Hz, {said.lost} lost", style))]
    latency = f"{said.latency * 1e3:.0f} ms, " if isfinite(said.latency) else ""
    rows.append(("", f"{latency}{said.damaged} damaged, {said.restarts} restarts"))
    if said.cause:
        rows.append(("", Text(said.cause, "red")))
    return rows


def _stop(sight: Sight) -> list[Row]:
    if sight.held is None:
        return [("stop", "none")]
    return [("stop", Text(str(sight.held["code"]), "bold red")), ("", str(sight.held["cause"]))]
