"""The live view of a run on a terminal, drawn with rich from the newest messages."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from time import monotonic

from rich.console import Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text as StyledText

from diffbotctl.estimation.imu_text import imu_text
from diffbotctl.messages import Goal, GoalState, Imu, Link, Range, Text
from diffbotctl.printable import fold_words
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.render.map_scene import Scene
from diffbotctl.time import SECOND
from diffbotctl.ui import run_text
from diffbotctl.ui.console import PrintableConsole
from diffbotctl.ui.map.layers import draw_map, overview_camera
from diffbotctl.ui.map.state import MapState
from diffbotctl.ui.text import shorten_text

FACTS_MAX_ROWS, SUMMARY_MAX_ROWS = 11, 14  # below the map
FRAME_WIDTH = 6  # columns of a title's frame
FAST_MIN_SPEED = 1.5  # times real time: the run is not paced
ESTIMATE_MIN_S = 1.0
MAP_MIN_ROWS = 5
LOG_INDENT = " " * 12  # of the rest of a line, below its text


class LiveView:
    """Renders snapshots; keeps the trail.

    `duration`: time limit of the run in s, None for none. `began`: monotonic time of the start, s.
    """

    def __init__(self, scene: Scene, duration: float | None = None, began: float = 0.0) -> None:
        self.map = MapState(scene)
        self.duration, self.began = duration, began

    def render(
        self, snapshot: RunSnapshot, width: int, height: int, now: float | None = None
    ) -> RenderableType:
        """The whole view for a terminal of `width` x `height` characters, at monotonic `now`.

        The last picture of a run has no facts: the summary below it has them, and the whole cause.
        """
        self.map.update(snapshot)
        title = title_text(self.map.scene)
        if snapshot.ending:
            style = "bold red" if snapshot.has_failed else "bold green"
            names = f"{self.map.scene.title}   {self.map.scene.simulated}  "
            ending = shorten_text(snapshot.ending, width - len(names) - FRAME_WIDTH)
            title.append("  ").append(ending, style)
        progress = None
        if now is not None:
            progress = progress_text(snapshot.time / SECOND, now - self.began, self.duration)
        facts = facts_table(snapshot, progress)
        if self.map.scene.commands == ("operator.twist",):  # nothing else drives it
            facts.add_row("drive", "`diffbotctl teleop` in another terminal")
        if run_text.newest_odometry(snapshot) is None:
            return Group(title) if snapshot.ending else Group(title, facts)
        below = SUMMARY_MAX_ROWS if snapshot.ending else FACTS_MAX_ROWS
        rows = max(height - below - 3, MAP_MIN_ROWS)
        camera = overview_camera(self.map, width - 4, rows)
        canvas = draw_map(self.map, camera, width - 4, rows)
        panel = Panel(canvas.text(), title=title, border_style="dim", height=rows + 2)
        return panel if snapshot.ending else Group(panel, facts)


def progress_text(time: float, elapsed: float, duration: float | None) -> str | None:
    """Share of the run's time limit, and the real time until then; None without anything to say.

    `time` is logical, `elapsed` real, both in s since the start. The first moments of a run do
    not tell its speed.
    """
    speed = time / elapsed if elapsed > ESTIMATE_MIN_S else 0.0
    pace = f", {speed:.0f} times real time" if speed > FAST_MIN_SPEED else ""
    if duration is None or time >= duration:
        return pace.removeprefix(", ") or None
    left = f", {duration_text((duration - time) / speed)} left" if speed > 0 else ""
    return f"{100 * time / duration:.0f} % of {duration:g} s{left}{pace}"


def duration_text(seconds: float) -> str:
    """`12 s`, `3 min 20 s` or `2 h 5 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def title_text(scene: Scene) -> StyledText:
    """The pipeline's name, and SIMULATED when it is."""
    title = StyledText().append(scene.title, "bold")
    if scene.simulated:
        title.append("  ").append(f" {scene.simulated} ", "black on yellow")
    return title


def facts_table(snapshot: RunSnapshot, progress: str | None = None) -> Table:
    """Pose, goal, wheels, IMU, range, link and stop as a table of two columns."""
    table = Table.grid(padding=(0, 1))
    table.add_column(style="bold", justify="right", no_wrap=True)
    table.add_column(overflow="ellipsis")

    def add(name: str, text: str, style: str | None = None) -> None:
        # As it is: a program or a person may have written brackets, which would be markup.
        table.add_row(StyledText(name), StyledText(text), style=style)

    odometry, stop = run_text.newest_odometry(snapshot), run_text.active_stop(snapshot)
    time = f"{snapshot.time / SECOND:.1f} s"
    add("time", time if progress is None else f"{time}  {progress}")
    for name, text in run_text.pose_rows(snapshot):
        add(name, text)
    if (goal := run_text.newest_message(snapshot, Goal)) is not None and goal.number:
        add("goal", run_text.goal_text(goal, snapshot.goals))
    if (state := run_text.newest_message(snapshot, GoalState)) is not None:
        add("state", run_text.goal_state_text(state))
    if (wheels := run_text.commanded_wheels(snapshot)) is not None:
        add("wheels", run_text.wheel_speeds_text(wheels, odometry))
    if (imu := run_text.newest_message(snapshot, Imu)) is not None:
        add("imu", imu_text(imu))
    for wire, message in snapshot.messages.items():
        if isinstance(message, Text):
            add(wire, message.text)
    if (reading := run_text.newest_message(snapshot, Range)) is not None:
        add("range", run_text.range_text(reading))
    if (link := run_text.newest_message(snapshot, Link)) is not None:
        add("link", run_text.link_text(link))
    if odometry is not None or stop is not None:
        add("stop", run_text.stop_text(stop), "bold red" if stop else None)
    return table


def show_live(
    scene: Scene, snapshots: Iterator[RunSnapshot], duration: float | None = None
) -> None:
    """Draw snapshots on the terminal until they end; the lines of the log stay above them.

    The last picture stays, with the cause of the end.
    """
    console = PrintableConsole(file=sys.stdout)
    view = LiveView(scene, duration, monotonic())
    with Live(console=console, auto_refresh=False) as live:
        for snapshot in snapshots:
            for line in snapshot.lines:
                style = run_text.LOG_STYLES.get(line.level)
                rows = fold_words(run_text.log_line_text(line), console.width, rest=LOG_INDENT)
                live.console.print("\n".join(rows), style=style, markup=False, soft_wrap=True)
            picture = view.render(snapshot, console.width, console.height, monotonic())
            live.update(picture, refresh=True)
