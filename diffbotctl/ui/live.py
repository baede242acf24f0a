"""The live view of a run on a terminal, drawn with rich from the newest messages."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from math import cos, hypot, sin
from typing import NamedTuple

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table

from diffbotctl.hub.latest import Snapshot
from diffbotctl.messages import Canvas, Goal, GoalState, Link, Range, Text, Wheels
from diffbotctl.ui import words
from diffbotctl.ui.map import Map, Point

TRAIL_STEP = 0.01  # m between two dots of the trail: finer is not seen
ROWS_OF_FACTS = 11
JUMP = 0.5  # m between two dots of the trail that no robot here drives in a tenth of a second


class Scene(NamedTuple):
    """What does not change during a run: its title and the walls and round obstacles to draw.

    `start` is where in the world the frame odom begins (m, m, rad). Of a field, all is shown.
    """

    title: str
    simulated: str
    walls: list[tuple[Point, Point]]
    obstacles: list[tuple[Point, float]]
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    is_field: bool = False


class LiveView:
    """Turns pictures into renderables; keeps the trail, in the world's frame."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.trail: list[tuple[Point, str]] = []
        self.last: Point | None = None
        self.sheet = 0

    def render(self, picture: Snapshot, width: int, height: int) -> RenderableType:
        """The whole view for a terminal of `width` x `height` characters."""
        odometry, in_world = words.located(picture)
        if odometry is None:
            return Group(title_line(self.scene), facts(picture))
        canvas = words.newest(picture, Canvas)
        sheet = canvas if isinstance(canvas, Canvas) else None
        at = self._world((odometry.x, odometry.y), in_world)
        self._extend(at, sheet)
        rows = max(height - ROWS_OF_FACTS - 3, 5)
        drawing = self._map(self._goal(picture, in_world), sheet, width - 4, rows)
        drawing.robot(at, odometry.heading + (0.0 if in_world else self.scene.start[2]))
        title = title_line(self.scene)
        return Group(
            Panel(drawing.text(), title=title, border_style="dim", height=rows + 2), facts(picture)
        )

    def _world(self, at: Point, in_world: bool) -> Point:
        """A point as the world's frame has it."""
        if in_world:
            return at
        x, y, heading = self.scene.start
        return (
            x + at[0] * cos(heading) - at[1] * sin(heading),
            y + at[0] * sin(heading) + at[1] * cos(heading),
        )

    def _goal(self, picture: Snapshot, in_world: bool) -> list[Point]:
        """Where the goal is, if there is one; it is told in the frame of the pose."""
        goal = words.newest(picture, Goal)
        if not isinstance(goal, Goal) or not goal.number:
            return []
        return [self._world((goal.x, goal.y), in_world)]

    def _extend(self, at: Point, sheet: Canvas | None) -> None:
        if sheet is not None and sheet.sheet != self.sheet:
            self.sheet = sheet.sheet
            self.trail.clear()
        last = self.last
        if last is not None and abs(at[0] - last[0]) + abs(at[1] - last[1]) <= TRAIL_STEP:
            return
        self.last = at
        if sheet is None or sheet.is_down:
            self.trail.append((at, sheet.pen if sheet else "cyan"))

    def _map(self, goal: list[Point], sheet: Canvas | None, width: int, height: int) -> Map:
        around = [self._world(corner, in_world=False) for corner in ((-0.1, -0.1), (0.1, 0.1))]
        seen = [*(at for at, _ in self.trail), *goal, *around]
        if self.scene.is_field:
            seen = [end for wall in self.scene.walls for end in wall]
        drawing = Map(width, height, seen, background=sheet.background if sheet else "")
        for start, end in self.scene.walls:
            drawing.line(start, end)
        for middle, radius in self.scene.obstacles:
            drawing.circle(middle, radius)
        before: Point | None = None
        for at, colour in self.trail:
            # A picture comes ten times a second; a longer way than this was no driving.
            near = before is not None and hypot(at[0] - before[0], at[1] - before[1]) < JUMP
            drawing.line(before if near and before else at, at, colour)
            before = at
        for at in goal:
            drawing.mark(at, "◎", "bold magenta")
        turtles = sheet.turtles if sheet else ()
        for i in range(0, len(turtles), 4):  # number, x, y, heading
            drawing.robot((turtles[i + 1], turtles[i + 2]), turtles[i + 3], "bold yellow")
        return drawing


def title_line(scene: Scene) -> str:
    """The pipeline's name, and SIMULATED when it is, as rich markup."""
    title = f"[bold]{scene.title}[/]"
    return title + (f"  [black on yellow] {scene.simulated} [/]" if scene.simulated else "")


def facts(picture: Snapshot) -> Table:
    """Pose, goal, wheels, range, link and stop as a table of two columns."""
    table = Table.grid(padding=(0, 1))
    table.add_column(style="bold", justify="right", no_wrap=True)
    table.add_column(overflow="ellipsis")
    known, _ = words.located(picture)
    state, goal = words.newest(picture, GoalState), words.newest(picture, Goal)
    wheels, reading = words.newest(picture, Wheels), words.newest(picture, Range)
    link = words.newest(picture, Link)
    table.add_row("time", f"{picture.time / 1e9:.1f} s")
    if known is not None:
        table.add_row("pose", words.pose(known))
    if isinstance(goal, Goal) and goal.number:
        table.add_row("goal", words.goal(goal.number, picture.goals, goal))
    if isinstance(state, GoalState):
        table.add_row("state", words.goal_state(state))
    if isinstance(wheels, Wheels):
        table.add_row("wheels", words.speeds(wheels, known))
    for wire, message in picture.messages.items():
        if isinstance(message, Text):
            table.add_row(wire, message.text)
    if isinstance(reading, Range):
        table.add_row("range", words.distance(reading))
    if isinstance(link, Link):
        table.add_row("link", words.link(link))
    stop = words.holding(picture)
    if known is None and stop is None:
        return table
    table.add_row("stop", words.stop(stop), style="bold red" if stop else None)
    return table


def show(scene: Scene, pictures: Iterator[Snapshot]) -> None:
    """Draw pictures on the terminal until they end; the last one stays."""
    console = Console(file=sys.stdout)
    view = LiveView(scene)
    with Live(console=console, auto_refresh=False, transient=True) as live:
        for picture in pictures:
            live.update(view.render(picture, console.width, console.height), refresh=True)
