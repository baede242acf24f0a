"""The live view of a run on a terminal, drawn with rich from the newest messages."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table

from diffbotctl.messages import Goal, GoalState, Link, Range, Text, Wheels
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.render.map_scene import Scene
from diffbotctl.ui import run_text
from diffbotctl.ui.map import layers
from diffbotctl.ui.map.canvas import MapCanvas
from diffbotctl.ui.map.trail import Trail, TurtleTrail

FACTS_MAX_ROWS = 11


class LiveView:
    """Turns pictures into renderables; keeps the trail."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.trail = Trail()
        self.sheet = TurtleTrail()

    def render(self, picture: RunSnapshot, width: int, height: int) -> RenderableType:
        """The whole view for a terminal of `width` x `height` characters."""
        odometry = run_text.newest_odometry(picture)
        self.sheet.see(picture)
        if odometry is not None:
            self.trail.see((odometry.x, odometry.y))
        rows = max(height - FACTS_MAX_ROWS - 3, 5)
        if odometry is None:
            return Group(title_line(self.scene), facts_table(picture))
        drawing = self._map(picture, width - 4, rows)
        title = title_line(self.scene)
        return Group(
            Panel(drawing.text(), title=title, border_style="dim", height=rows + 2),
            facts_table(picture),
        )

    def _map(self, picture: RunSnapshot, width: int, height: int) -> MapCanvas:
        places = self.trail.places
        camera = layers.overview_camera(self.scene, picture, places, width, height)
        return layers.draw_map(self.scene, picture, places, camera, width, height, sheet=self.sheet)


def title_line(scene: Scene) -> str:
    """The pipeline's name, and SIMULATED when it is, as rich markup."""
    title = f"[bold]{scene.title}[/]"
    return title + (f"  [black on yellow] {scene.simulated} [/]" if scene.simulated else "")


def facts_table(picture: RunSnapshot) -> Table:
    """Pose, goal, wheels, range, link and stop as a table of two columns."""
    table = Table.grid(padding=(0, 1))
    table.add_column(style="bold", justify="right", no_wrap=True)
    table.add_column(overflow="ellipsis")
    known = run_text.newest_odometry(picture)
    state, goal = (
        run_text.newest_message(picture, GoalState),
        run_text.newest_message(picture, Goal),
    )
    wheels, reading = (
        run_text.newest_message(picture, Wheels),
        run_text.newest_message(picture, Range),
    )
    link = run_text.newest_message(picture, Link)
    table.add_row("time", f"{picture.time / 1e9:.1f} s")
    if known is not None:
        table.add_row("pose", run_text.pose_text(known))
    if isinstance(goal, Goal) and goal.number:
        table.add_row("goal", run_text.goal_text(goal.number, picture.goals, goal))
    if isinstance(state, GoalState):
        table.add_row("state", run_text.goal_state_text(state))
    if isinstance(wheels, Wheels):
        table.add_row("wheels", run_text.wheel_speeds_text(wheels, known))
    for wire, message in picture.messages.items():
        if isinstance(message, Text):
            table.add_row(wire, message.text)
    if isinstance(reading, Range):
        table.add_row("range", run_text.range_text(reading))
    if isinstance(link, Link):
        table.add_row("link", run_text.link_text(link))
    stop = run_text.active_stop(picture)
    if known is None and stop is None:
        return table
    table.add_row("stop", run_text.stop_text(stop), style="bold red" if stop else None)
    return table


def show_live(scene: Scene, pictures: Iterator[RunSnapshot]) -> None:
    """Draw pictures on the terminal until they end; the lines of the log stay above them."""
    console = Console(file=sys.stdout)
    view = LiveView(scene)
    with Live(console=console, auto_refresh=False, transient=True) as live:
        for picture in pictures:
            for line in picture.lines:
                live.console.print(
                    run_text.log_line_text(line),
                    style=run_text.LOG_STYLES.get(line.level),
                    markup=False,
                )
            live.update(view.render(picture, console.width, console.height), refresh=True)
