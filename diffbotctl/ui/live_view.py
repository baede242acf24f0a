"""The live view of a run on a terminal, drawn with rich from the newest messages."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from rich.console import Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table

from diffbotctl.estimation.imu_text import imu_text
from diffbotctl.messages import Goal, GoalState, Imu, Link, Range, Text, Wheels
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.render.map_scene import Scene
from diffbotctl.time import SECOND
from diffbotctl.ui import run_text
from diffbotctl.ui.console import PrintableConsole
from diffbotctl.ui.map.layers import draw_map, overview_camera
from diffbotctl.ui.map.state import MapState

FACTS_MAX_ROWS = 12
MAP_MIN_ROWS = 5


class LiveView:
    """Renders snapshots; keeps the trail."""

    def __init__(self, scene: Scene) -> None:
        self.map = MapState(scene)

    def render(self, snapshot: RunSnapshot, width: int, height: int) -> RenderableType:
        """The whole view for a terminal of `width` x `height` characters."""
        self.map.update(snapshot)
        title = title_markup(self.map.scene)
        if run_text.newest_odometry(snapshot) is None:
            return Group(title, facts_table(snapshot))
        rows = max(height - FACTS_MAX_ROWS - 3, MAP_MIN_ROWS)
        camera = overview_camera(self.map, width - 4, rows)
        canvas = draw_map(self.map, camera, width - 4, rows)
        panel = Panel(canvas.text(), title=title, border_style="dim", height=rows + 2)
        return Group(panel, facts_table(snapshot))


def title_markup(scene: Scene) -> str:
    """The pipeline's name, and SIMULATED when it is, as rich markup."""
    title = f"[bold]{scene.title}[/]"
    return title + (f"  [black on yellow] {scene.simulated} [/]" if scene.simulated else "")


def facts_table(snapshot: RunSnapshot) -> Table:
    """Pose, goal, wheels, IMU, range, link and stop as a table of two columns."""
    table = Table.grid(padding=(0, 1))
    table.add_column(style="bold", justify="right", no_wrap=True)
    table.add_column(overflow="ellipsis")
    odometry, stop = run_text.newest_odometry(snapshot), run_text.active_stop(snapshot)
    table.add_row("time", f"{snapshot.time / SECOND:.1f} s")
    if odometry is not None:
        table.add_row("pose", run_text.pose_text(odometry))
    if (goal := run_text.newest_message(snapshot, Goal)) is not None and goal.number:
        table.add_row("goal", run_text.goal_text(goal, snapshot.goals))
    if (state := run_text.newest_message(snapshot, GoalState)) is not None:
        table.add_row("state", run_text.goal_state_text(state))
    if (wheels := run_text.newest_message(snapshot, Wheels)) is not None:
        table.add_row("wheels", run_text.wheel_speeds_text(wheels, odometry))
    if (imu := run_text.newest_message(snapshot, Imu)) is not None:
        table.add_row("imu", imu_text(imu))
    for wire, message in snapshot.messages.items():
        if isinstance(message, Text):
            table.add_row(wire, message.text)
    if (reading := run_text.newest_message(snapshot, Range)) is not None:
        table.add_row("range", run_text.range_text(reading))
    if (link := run_text.newest_message(snapshot, Link)) is not None:
        table.add_row("link", run_text.link_text(link))
    if odometry is not None or stop is not None:
        table.add_row("stop", run_text.stop_text(stop), style="bold red" if stop else None)
    return table


def show_live(scene: Scene, snapshots: Iterator[RunSnapshot]) -> None:
    """Draw snapshots on the terminal until they end; the lines of the log stay above them."""
    console = PrintableConsole(file=sys.stdout)
    view = LiveView(scene)
    with Live(console=console, auto_refresh=False, transient=True) as live:
        for snapshot in snapshots:
            for line in snapshot.lines:
                style = run_text.LOG_STYLES.get(line.level)
                live.console.print(run_text.log_line_text(line), style=style, markup=False)
            live.update(view.render(snapshot, console.width, console.height), refresh=True)
