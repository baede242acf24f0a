"""The facts beside the map: pose, goal, wheels, range, supply, link and stop, a row each.

The dashboard's panels: each turns what is known of a run into something that rich can print.
"""

from __future__ import annotations

from itertools import islice
from math import degrees, isfinite, pi, remainder
from typing import Any

from rich.table import Table
from rich.text import Text

from diffbotctl.messages import Battery, Duty, Goal, GoalState, Link, Range, Wheels
from diffbotctl.messages import Text as Words
from diffbotctl.ui import run_text
from diffbotctl.ui.dash.state import Fields, RunView
from diffbotctl.ui.plot.plots import render_chart
from diffbotctl.ui.teleop.deadman import TeleopDeadman
from diffbotctl.ui.text import render_bar, render_signed_bar


def facts_panel(sight: RunView, width: int, plain: bool = False) -> Table:
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


def _pose(sight: RunView) -> list[Row]:
    said = run_text.newest_odometry(sight.picture)
    if said is None:
        return []
    return [
        ("pose", f"{said.x:+.3f} {said.y:+.3f} m {degrees(remainder(said.heading, 2 * pi)):+.1f}°"),
        ("", f"{said.linear:+.3f} m/s {said.angular:+.2f} rad/s"),
    ]


def _goal(sight: RunView) -> list[Row]:
    goal, state = (
        run_text.newest_message(sight.picture, Goal),
        run_text.newest_message(sight.picture, GoalState),
    )
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


def _wheels(sight: RunView, width: int, plain: bool) -> list[Row]:
    """Commanded above measured, for each wheel."""
    robot, odometry = sight.scene.robot, run_text.newest_odometry(sight.picture)
    commanded = sight.picture.messages.get("gate.wheels") or run_text.newest_message(
        sight.picture, Wheels
    )
    if robot is None or not isinstance(commanded, Wheels | Duty):
        return []
    rows: list[Row] = []
    length = max(width - 8, 5)
    for side, sign, diameter in (
        ("left", -1, robot.left_diameter),
        ("right", 1, robot.right_diameter),
    ):
        most = 1.0 if isinstance(commanded, Duty) else robot.speed / (diameter / 2)
        wanted = getattr(commanded, side)
        rows.append((side, _speed(wanted, most, length, "magenta", plain)))
        if odometry is not None and isinstance(commanded, Wheels):
            speed = odometry.linear + sign * odometry.angular * robot.track / 2
            rows.append(("", _speed(speed / (diameter / 2), most, length, "cyan", plain)))
    return rows


def _speed(value: float, most: float, length: int, style: str, plain: bool) -> Text:
    return Text.assemble((render_signed_bar(value / most, length, plain), style), f" {value:+6.2f}")


def _ranges(sight: RunView, width: int, plain: bool) -> list[Row]:
    rows: list[Row] = []
    beams = {beam.topic: beam.reach for beam in sight.scene.beams}
    for wire, message in sight.picture.messages.items():
        if isinstance(message, Range):
            reach = beams.get(wire, message.distance or 1.0)
            known = message.state in ("measured", "clear")
            share = message.distance / reach if known else 0.0
            style = "red" if message.state in ("too_close", "fault") else "yellow"
            told = Text.assemble((render_bar(share, max(width - 10, 4), plain), style))
            rows.append(("range", told.append(f" {run_text.range_text(message)}")))
    return rows


def _battery(sight: RunView) -> list[Row]:
    said = run_text.newest_message(sight.picture, Battery)
    if not isinstance(said, Battery):
        return []
    return [("supply", Text(f"{said.volts:.1f} V", "red" if said.low else ""))]


def _link(sight: RunView) -> list[Row]:
    said = run_text.newest_message(sight.picture, Link)
    if not isinstance(said, Link):
        return []
    rate = max(
        (row["rate"] for wire, row in sight.rates.items() if wire == "robot.encoders"), default=0.0
    )
    style = "" if said.state == "up" else "red"
    rows: list[Row] = [("link", Text(f"{said.state} {rate:.0f} Hz, {said.lost} lost", style))]
    latency = f"{said.latency * 1e3:.0f} ms, " if isfinite(said.latency) else ""
    rows.append(("", f"{latency}{said.damaged} damaged, {said.restarts} restarts"))
    if said.cause:
        rows.append(("", Text(said.cause, "red")))
    return rows


def _stop(sight: RunView) -> list[Row]:
    if sight.held is None:
        return [("stop", "none")]
    return [("stop", Text(str(sight.held["code"]), "bold red")), ("", str(sight.held["cause"]))]


STOP_STYLE = "bold white on red"
PLOT_SPAN_S = 30.0  # s of a chart


def title_line(sight: RunView) -> Text:
    """Pipeline, robot, time, and SIMULATED where it is."""
    out = Text(no_wrap=True, overflow="ellipsis")
    out.append(sight.scene.title or sight.engine, "bold")
    out.append(f"  {sight.picture.time / 1e9:.1f} s")
    if sight.scene.simulated:
        out.append(f"  {sight.scene.simulated}", "black on yellow")
    if sight.ended:
        out.append("  the run has ended", STOP_STYLE)
    return out


def stop_banner(sight: RunView) -> Text:
    """What holds the robot, over the whole width; empty when nothing does."""
    held = sight.held
    if held is None:
        return Text()
    way_out = "r: resume" if held["latched"] else "ends by itself"
    said = f" STOPPED  {held['code']}: {held['cause']}  ({way_out}) "
    return Text(said, STOP_STYLE)


def keyboard_line(reins: TeleopDeadman) -> Text:
    """How the keys drive: mode, speeds, whether they do just now, and how far the terminal is."""
    out, hand = Text(no_wrap=True, overflow="ellipsis"), reins.hand
    out.append(
        " DRIVING " if reins.drives else " keys ",
        *(["black on green"] if reins.drives else ["reverse"]),
    )
    held = hand.mode == "hold"
    out.append(" HOLD a key " if held else " LATCHED until the next key ", "" if held else "bold")
    out.append(f" {hand.speed:.2f} m/s {hand.turn:.2f} rad/s")
    if reins.pulse.round_trip is not None:
        out.append(f"  terminal {reins.pulse.round_trip * 1e3:.0f} ms", "dim")
    if hand.stuttered:
        out.append("  gap: the keyboard repeats late", "yellow")
    return out


def plots_panel(
    sight: RunView, names: list[str], width: int, height: int, plain: bool = False
) -> Text:
    """The chosen fields over the last half minute."""
    if not names:
        return Text("p chooses what is plotted", "dim")
    return render_chart(
        [(name, list(sight.numbers.get(name, ()))) for name in names],
        PLOT_SPAN_S,
        width,
        height,
        plain,
    )


def blocks_panel(sight: RunView, height: int) -> Table:
    """Each block with its rate, what it costs and its last error."""
    columns = [
        name
        for name in ("busy", "overruns", "last_error")
        if any(row.get(name) is not None for row in sight.blocks)
    ]
    table = Table(box=None, pad_edge=False, header_style="bold", expand=True)
    for name in ("block", "rate", "age", *columns):
        rest = 1 if name == "last_error" else None  # it takes what the figures leave
        table.add_column(name.replace("_", " "), no_wrap=True, overflow="ellipsis", ratio=rest)
    for row in islice(sight.blocks, max(height - 1, 1)):
        age = "" if row["age"] is None else f"{row['age']:.1f} s"
        table.add_row(
            row["block"],
            f"{row['rate']:.0f} Hz",
            age,
            *(_cell(name, row.get(name)) for name in columns),
        )
    return table


def _cell(name: str, value: Any) -> str:
    if value is None:
        return ""
    if name == "last_error":
        return f"{value['time'] / 1e9:.1f} s: {value['text']}"
    return f"{100 * value:.2f} %" if name == "busy" else str(value)


def parameters_panel(sight: RunView, at: int, height: int) -> Table:
    """The live parameters, the one at `at` marked, as many as there is room for."""
    rows = live_parameters(sight)
    table = Table(box=None, pad_edge=False, header_style="bold", expand=True)
    for name in ("parameter", "value", "unit"):
        table.add_column(name, no_wrap=True)
    table.add_column("what it is", no_wrap=True, overflow="ellipsis", ratio=1)
    room = max(height - 1, 1)
    first = min(max(at - room // 2, 0), max(len(rows) - room, 0))
    for number, row in enumerate(rows[first : first + room], first):
        style = "reverse" if number == at else "bold" if row["changed"] else ""
        value = row["value"]
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        table.add_row(row["parameter"], shown, row["unit"], row["help"], style=style)
    if not rows:
        table.add_row("no block of this pipeline has a parameter that may change while it runs")
    return table


def live_parameters(sight: RunView) -> list[Fields]:
    """The parameters that may change while the pipeline runs."""
    return [row for row in sight.parameters if row["live"]]


def log_panel(sight: RunView, height: int) -> Text:
    """The newest lines that fit."""
    lines = [
        Text(run_text.log_line_text(line), run_text.LOG_STYLES.get(line.level, ""))
        for line in sight.log[-height:]
    ]
    return Text("\n", no_wrap=True, overflow="ellipsis").join(lines)
