"""The dashboard's facts: pose, goal, wheels, IMU, ranges, supply, link and stop, with units."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from math import degrees, isfinite, pi, remainder
from textwrap import wrap
from typing import NamedTuple

from rich.text import Text

from diffbotctl import messages
from diffbotctl.estimation.imu_text import imu_lines
from diffbotctl.messages import Battery, Duty, Goal, GoalState, Imu, Link, Range, Wheels
from diffbotctl.ui.dash.state import RunView
from diffbotctl.ui.run_text import commanded_wheels, newest_message, newest_odometry, range_text
from diffbotctl.ui.text import render_bar, render_signed_bar

NAME_WIDTH = 6  # characters of the names
PERCENT = 100.0
BAR_MIN_WIDTH = 5
RANGE_TEXT_WIDTH = 10  # characters of `1.234 m` and `too close`

Row = tuple[str, str | Text]


def facts_panel(view: RunView, width: int, height: int, plain: bool = False) -> Text:
    """The facts in `width` characters; without bars where those need more than `height` rows.

    A text that is longer than a row is folded between words.
    """
    value_width = width - NAME_WIDTH - 1
    rows = _rows(view, value_width, plain)
    if sum(_height(row, value_width) for row in rows) > height:
        rows = _rows(view, 0, plain)
    # A table of rich takes several times as long to draw.
    lines = chain.from_iterable(_lines(*row, value_width) for row in rows)
    return Text("\n", no_wrap=True, end="").join(lines)


def _lines(name: str, value: str | Text, width: int) -> Iterator[Text]:
    """A row of the facts, folded where its value is longer than `width`."""
    text = value if isinstance(value, Text) else Text(value)
    parts = [text]
    if len(text) > width:
        parts = [Text(part, text.style) for part in wrap(text.plain, width)]
    for number, part in enumerate(parts):
        yield Text.assemble((("" if number else name).ljust(NAME_WIDTH + 1), "bold"), part)


def _rows(view: RunView, bars_width: int, plain: bool) -> list[Row]:
    """Names and values. Without a width for bars what a small screen may cut off is last."""
    ranges = _ranges(view, bars_width, plain)
    rest = chain(_battery(view), _link(view), _stop(view))
    if bars_width:
        rows = chain(_wheel_bars(view, bars_width, plain), _imu(view), ranges, rest)
    else:
        rows = chain(_wheels(view), _imu(view), rest, ranges)
    return list(chain(_pose(view), _goal(view), rows, _texts(view)))


def _height(row: Row, width: int) -> int:
    """The rows that a fact takes; a text that folds takes at most one more than its letters do."""
    length = len(row[1])
    return 1 if length <= width else -(-length // width) + 1


def _pose(view: RunView) -> Iterator[Row]:
    pose = newest_odometry(view.snapshot)
    if pose is not None:
        heading = degrees(remainder(pose.heading, 2 * pi))
        yield "pose", f"{pose.x:+z.3f} {pose.y:+z.3f} m {heading:+z.1f}°"
        yield "", f"{pose.linear:+z.3f} m/s {pose.angular:+z.2f} rad/s"


def _goal(view: RunView) -> Iterator[Row]:
    goal, state = newest_message(view.snapshot, Goal), newest_message(view.snapshot, GoalState)
    name = "goal"
    if goal is not None and goal.number:
        heading = "" if goal.heading is None else f" {degrees(goal.heading):+.1f}°"
        yield name, f"{goal.x:+z.3f} {goal.y:+z.3f} m{heading}"
        name = ""
    if state is None:
        return
    text = Text(state.state.replace("_", " "), _goal_style(state))
    if state.state not in ("idle", "reached"):
        text.append(f" {state.distance:.3f} m {degrees(state.turn):+z.0f}°")
    yield name, text
    if state.cause:
        yield "", Text(state.cause, "red")


def _goal_style(state: GoalState) -> str:
    match state.state:
        case "reached":
            return "green"
        case "reached_unsure" | "blocked" | "stuck" | "given_up" | "cancelled":
            return "red"
        case "idle" | "turning" | "driving" | "aligning":
            return ""


class _WheelSpeeds(NamedTuple):
    """Commanded and measured speed of a wheel, or its duty, with their limit and unit."""

    side: str
    commanded: float
    measured: float | None
    maximum: float
    unit: str


def _wheel_speeds(view: RunView) -> Iterator[_WheelSpeeds]:
    robot, odometry = view.scene.robot, newest_odometry(view.snapshot)
    commanded = commanded_wheels(view.snapshot)
    if robot is None:
        return
    for side, sign, diameter in (
        ("left", -1, robot.left_diameter),
        ("right", 1, robot.right_diameter),
    ):
        if isinstance(commanded, Duty):
            duty = PERCENT * (commanded.left if side == "left" else commanded.right)
            yield _WheelSpeeds(side, duty, None, PERCENT, "%")
        elif isinstance(commanded, Wheels):
            command = commanded.left if side == "left" else commanded.right
            measured = None
            if odometry is not None:
                speed = odometry.linear + sign * odometry.angular * robot.track / 2
                measured = speed / (diameter / 2)
            yield _WheelSpeeds(side, command, measured, robot.speed / (diameter / 2), "rad/s")


def _wheel_bars(view: RunView, width: int, plain: bool) -> Iterator[Row]:
    """Commanded above measured speed, for each wheel."""
    for side, commanded, measured, maximum, unit in _wheel_speeds(view):
        lines = ((side, commanded, "magenta", "set"), ("", measured, "cyan", "now"))
        for name, value, style, which in lines:
            if value is not None:
                text = f" {value:+6.2f} {unit} {which}"
                bar_width = max((width - len(text) - 1) | 1, BAR_MIN_WIDTH)  # odd: it has a middle
                bar = render_signed_bar(value / maximum, bar_width, plain)
                yield name, Text.assemble((bar, style), text)


def _wheels(view: RunView) -> Iterator[Row]:
    """Commanded and measured speed of each wheel in one row."""
    for side, commanded, measured, _, unit in _wheel_speeds(view):
        texts = [f"{value:+.2f}" for value in (commanded, measured) if value is not None]
        yield side, f"{' / '.join(texts)} {unit}"


def _imu(view: RunView) -> Iterator[Row]:
    imu = newest_message(view.snapshot, Imu)
    if imu is None:
        return
    style = {"failed": "red", "zeroing": "yellow", "working": ""}[imu.state]
    for number, line in enumerate(imu_lines(imu)):
        yield "" if number else "imu", Text(line, style)


def _ranges(view: RunView, width: int, plain: bool) -> Iterator[Row]:
    reaches = {beam.topic: beam.reach for beam in view.scene.beams}
    for wire, message in view.snapshot.messages.items():
        if not isinstance(message, Range):
            continue
        is_valid = message.state in ("measured", "clear")
        share = message.distance / reaches.get(wire, message.distance or 1.0) if is_valid else 0.0
        style, text = "yellow" if is_valid else "red", range_text(message)
        if width:
            bar = render_bar(share, max(width - RANGE_TEXT_WIDTH, BAR_MIN_WIDTH), plain)
            yield "range", Text.assemble((bar, style), f" {text}")
        else:
            yield "range", Text(text, "" if is_valid else style)


def _battery(view: RunView) -> Iterator[Row]:
    battery = newest_message(view.snapshot, Battery)
    if battery is not None:
        yield "supply", Text(f"{battery.volts:.1f} V", "red" if battery.low else "")


def _link(view: RunView) -> Iterator[Row]:
    link = newest_message(view.snapshot, Link)
    if link is None:
        return
    rate = view.rates["robot.encoders"]["rate"] if "robot.encoders" in view.rates else 0.0
    style = "" if link.state == "up" else "red"
    yield "link", Text(f"{link.state} {rate:.0f} Hz, {link.lost} lost", style)
    latency = f"{link.latency * 1e3:.0f} ms, " if isfinite(link.latency) else ""
    yield "", f"{latency}{link.damaged} damaged, {link.restarts} restarts"
    if link.cause:
        yield "", Text(link.cause, "red")


def _stop(view: RunView) -> Iterator[Row]:
    if view.held is None:
        if view.has_map:
            yield "stop", "none"
    else:
        yield "stop", Text(str(view.held["code"]), "bold red")  # the banner has the cause


def _texts(view: RunView) -> Iterator[Row]:
    for wire, message in view.snapshot.messages.items():
        if isinstance(message, messages.Text):
            name = wire.rpartition(".")[0]
            fits = len(name) <= NAME_WIDTH
            yield (name, message.text) if fits else ("", f"{name}: {message.text}")
