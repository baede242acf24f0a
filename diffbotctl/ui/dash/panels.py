"""The dashboard's panels: each renders a part of a RunView with rich."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, islice
from math import degrees, isfinite, pi, remainder
from textwrap import wrap
from typing import Any, Literal, get_args

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from diffbotctl import messages
from diffbotctl.estimation.imu_text import imu_lines
from diffbotctl.messages import Battery, Duty, Goal, GoalState, Imu, Link, Range, Wheels
from diffbotctl.time import SECOND
from diffbotctl.ui.dash.state import RunView
from diffbotctl.ui.plot.plots import render_chart
from diffbotctl.ui.run_text import (
    LOG_STYLES,
    log_line_text,
    newest_message,
    newest_odometry,
    range_text,
)
from diffbotctl.ui.teleop.deadman import TeleopDeadman
from diffbotctl.ui.text import render_bar, render_signed_bar

PanelName = Literal["map", "plots", "parameters", "blocks", "log", "help"]
PANELS: tuple[PanelName, ...] = get_args(PanelName)[:-1]  # in the order of their keys
STOP_STYLE = "bold white on red"
PLOT_SPAN_S = 30.0
IMU_ROWS = 4  # at most for why it has failed; `why` has all of it
NAME_WIDTH = 6  # characters of the names of the facts
HELP_LINE = "1-5 views  g goal  p plot  f follow  [ ] zoom  t keys  b latch  r resume  ? help"
HELP = (
    ("click", "set a goal there"),
    ("drag", "set a goal with a heading"),
    ("wheel, [ ]", "zoom"),
    ("right drag, { } ( )", "pan left, right, up, down"),
    ("1 2 3 4 5, n", "map, plots, parameters, blocks, log; the next panel"),
    ("3, arrows, enter", "change a parameter"),
    ("5, enter", "set the log level of a block"),
    ("g", "enter a goal in numbers"),
    ("space", "stop driving; if not driving: stop the robot until r"),
    ("r", "resume"),
    ("f, 0", "keep the robot in the middle; keep everything in view"),
    ("p", "choose the plotted fields"),
    ("arrows", "drive"),
    ("t", "change to the other set of letters"),
    ("b", "drive while a key is held, or until the next key"),
    ("ctrl-c", "leave"),
)

Row = tuple[str, str | Text]


def facts_panel(view: RunView, width: int, plain: bool = False) -> Table:
    """Pose, goal, wheels, IMU, range, battery, link and stop, in `width` characters."""
    value_width = width - NAME_WIDTH - 1
    table = Table.grid(padding=(0, 1))
    table.add_column(style="bold", no_wrap=True, width=NAME_WIDTH)
    table.add_column(no_wrap=True, overflow="ellipsis", width=value_width)
    for row in chain(
        _pose(view),
        _goal(view),
        _wheels(view, value_width, plain),
        _imu(view, value_width),
        _ranges(view, value_width, plain),
        _battery(view),
        _link(view),
        _stop(view),
        _texts(view),
    ):
        table.add_row(*row)
    return table


def _pose(view: RunView) -> Iterator[Row]:
    pose = newest_odometry(view.snapshot)
    if pose is not None:
        heading = degrees(remainder(pose.heading, 2 * pi))
        yield "pose", f"{pose.x:+.3f} {pose.y:+.3f} m {heading:+.1f}°"
        yield "", f"{pose.linear:+.3f} m/s {pose.angular:+.2f} rad/s"


def _goal(view: RunView) -> Iterator[Row]:
    goal, state = newest_message(view.snapshot, Goal), newest_message(view.snapshot, GoalState)
    name = "goal"
    if goal is not None and goal.number:
        heading = "" if goal.heading is None else f" {degrees(goal.heading):+.1f}°"
        yield name, f"{goal.x:+.3f} {goal.y:+.3f} m{heading}"
        name = ""
    if state is None:
        return
    text = Text(state.state.replace("_", " "), _goal_style(state))
    if state.state not in ("idle", "reached"):
        text.append(f" {state.distance:.3f} m {degrees(state.turn):+.0f}°")
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


def _wheels(view: RunView, width: int, plain: bool) -> Iterator[Row]:
    """Commanded above measured speed, for each wheel."""
    robot, odometry = view.scene.robot, newest_odometry(view.snapshot)
    commanded = view.snapshot.messages.get("gate.wheels") or newest_message(view.snapshot, Wheels)
    if robot is None or not isinstance(commanded, Wheels | Duty):
        return
    bar_width = max(width - 8, 5)

    def bar(value: float, maximum: float, style: str) -> Text:
        signed_bar = render_signed_bar(value / maximum, bar_width, plain)
        return Text.assemble((signed_bar, style), f" {value:+6.2f}")

    for side, command, sign, diameter in (
        ("left", commanded.left, -1, robot.left_diameter),
        ("right", commanded.right, 1, robot.right_diameter),
    ):
        maximum = 1.0 if isinstance(commanded, Duty) else robot.speed / (diameter / 2)
        yield side, bar(command, maximum, "magenta")
        if odometry is not None and isinstance(commanded, Wheels):
            speed = odometry.linear + sign * odometry.angular * robot.track / 2
            yield "", bar(speed / (diameter / 2), maximum, "cyan")


def _imu(view: RunView, width: int) -> Iterator[Row]:
    imu = newest_message(view.snapshot, Imu)
    if imu is None:
        return
    style = {"failed": "red", "zeroing": "yellow", "working": ""}[imu.state]
    lines = (wrap(line, width, max_lines=IMU_ROWS, placeholder="...") for line in imu_lines(imu))
    parts = list(chain.from_iterable(lines))
    for number, part in enumerate(parts):
        yield "" if number else "imu", Text(part, style)


def _ranges(view: RunView, width: int, plain: bool) -> Iterator[Row]:
    ranges = {beam.topic: beam.reach for beam in view.scene.beams}
    for wire, message in view.snapshot.messages.items():
        if not isinstance(message, Range):
            continue
        is_valid = message.state in ("measured", "clear")
        maximum = ranges.get(wire, message.distance or 1.0)
        share = message.distance / maximum if is_valid else 0.0
        bar = render_bar(share, max(width - 10, 4), plain)
        style = "yellow" if is_valid else "red"
        yield "range", Text.assemble((bar, style), f" {range_text(message)}")


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
        yield "stop", "none"
    else:
        yield "stop", Text(str(view.held["code"]), "bold red")
        yield "", str(view.held["cause"])


def _texts(view: RunView) -> Iterator[Row]:
    for wire, message in view.snapshot.messages.items():
        if isinstance(message, messages.Text):
            yield wire.partition(".")[0][:NAME_WIDTH], message.text


def title_line(view: RunView) -> Text:
    """Pipeline, robot, time, and SIMULATED where it is."""
    out = Text(no_wrap=True, overflow="ellipsis")
    out.append(view.scene.title or view.engine, "bold")
    out.append(f"  {view.snapshot.time / SECOND:.1f} s")
    if view.scene.simulated:
        out.append(f"  {view.scene.simulated}", "black on yellow")
    if view.ended:
        out.append("  the run has ended", STOP_STYLE)
    return out


def stop_banner(view: RunView) -> Text:
    """The stop in force, over the whole width; empty when there is none."""
    stop = view.held
    if stop is None:
        return Text()
    end = "r: resume" if stop["latched"] else "ends by itself"
    return Text(f" STOPPED  {stop['code']}: {stop['cause']}  ({end}) ", STOP_STYLE)


def keyboard_line(deadman: TeleopDeadman) -> Text:
    """Mode and speeds of the keys, whether they drive now, and the terminal's round-trip time."""
    out, keyboard = Text(no_wrap=True, overflow="ellipsis"), deadman.keyboard
    if deadman.is_driving:
        out.append(" DRIVING ", "black on green")
    else:
        out.append(" keys ", "reverse")
    if keyboard.mode == "hold":
        out.append(" HOLD a key ")
    else:
        out.append(" LATCHED until the next key ", "bold")
    out.append(f" {keyboard.speed:.2f} m/s {keyboard.turn_rate:.2f} rad/s")
    if deadman.heartbeat.round_trip is not None:
        out.append(f"  terminal {deadman.heartbeat.round_trip * 1e3:.0f} ms", "dim")
    if keyboard.has_gap:
        out.append("  gap: the first key repeat was late", "yellow")
    return out


def plots_panel(
    view: RunView, names: list[str], width: int, height: int, plain: bool = False
) -> Text:
    """The chosen fields over the last half minute."""
    if not names:
        return Text("press p to choose the plotted fields", "dim")
    series = [(name, list(view.numbers.get(name, ()))) for name in names]
    return render_chart(series, PLOT_SPAN_S, width, height, plain)


def blocks_panel(view: RunView, height: int) -> Table:
    """Each block with its rate, the processor time that it takes and its last error."""
    optional = [
        name
        for name in ("busy", "overruns", "last_error")
        if any(row.get(name) is not None for row in view.blocks)
    ]
    table = _table()
    for name in ("block", "rate", "age", *optional):
        ratio = 1 if name == "last_error" else None  # it takes the remaining width
        table.add_column(name.replace("_", " "), no_wrap=True, overflow="ellipsis", ratio=ratio)
    for row in islice(view.blocks, max(height - 1, 1)):
        age = "" if row["age"] is None else f"{row['age']:.1f} s"
        cells = (_cell(name, row.get(name)) for name in optional)
        table.add_row(row["block"], f"{row['rate']:.0f} Hz", age, *cells)
    return table


def _table() -> Table:
    return Table(box=None, pad_edge=False, header_style="bold", expand=True)


def _cell(name: str, value: Any) -> str:
    if value is None:
        return ""
    if name == "last_error":
        return f"{value['time'] / SECOND:.1f} s: {value['text']}"
    return f"{100 * value:.2f} %" if name == "busy" else str(value)


def parameters_panel(view: RunView, selected: int, height: int) -> Table:
    """The live parameters around the selected one, as many as fit."""
    rows = view.live_parameters
    table = _table()
    for name in ("parameter", "value", "unit"):
        table.add_column(name, no_wrap=True)
    table.add_column("description", no_wrap=True, overflow="ellipsis", ratio=1)
    count = max(height - 1, 1)
    first = min(max(selected - count // 2, 0), max(len(rows) - count, 0))
    for number, row in enumerate(rows[first : first + count], first):
        style = "reverse" if number == selected else "bold" if row["changed"] else ""
        value = row["value"]
        text = f"{value:.6g}" if isinstance(value, float) else str(value)
        table.add_row(row["parameter"], text, row["unit"], row["help"], style=style)
    if not rows:
        table.add_row("this pipeline has no parameter that can change during a run")
    return table


def log_panel(view: RunView, height: int) -> Text:
    """The newest lines of the log that fit."""
    lines = view.log[-height:]
    texts = [Text(log_line_text(line), LOG_STYLES.get(line.level, "")) for line in lines]
    return Text("\n", no_wrap=True, overflow="ellipsis").join(texts)


def help_panel(letters: str) -> RenderableType:
    """Every key; `letters` describes those that drive."""
    rows = [Text.assemble((f"{keys:<21}", "bold"), effect) for keys, effect in HELP]
    return Group(*rows, Text(letters))
