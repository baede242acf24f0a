"""Draws the steps of a calibration: lines, a bar, pictures of points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from diffbotctl.calibrate.step import Drawing
    from diffbotctl.calibrate.step import Progress as Done

WIDTH, HEIGHT = 64, 18  # characters of a drawing
FINEST = 0.02  # m across a drawing at least
SIGNS = "ox+*"
STYLES = ("red", "green", "blue", "magenta")


class StepScreen:
    """A terminal; without one, plain lines and no bar."""

    def __init__(self, console: Console | None = None) -> None:
        self.console = console or Console(highlight=False)
        self.bar: Progress | None = None

    def say(self, text: str) -> None:
        """A line, below a bar that is finished with it."""
        self.rest()
        self.console.print(text, markup=False, soft_wrap=True)

    def progress(self, progress: Done) -> None:
        """A bar for what is under way."""
        if not self.console.is_terminal:
            return
        if self.bar is None:
            columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
            self.bar = Progress(*columns, console=self.console, transient=True)
            self.bar.start()
            self.bar.add_task(progress.what, total=progress.total)
        task = self.bar.task_ids[0]
        self.bar.update(
            task, description=progress.what, completed=progress.done, total=progress.total
        )

    def draw(self, drawing: Drawing) -> None:
        """Points on a map, each kind by its own sign, and the origin."""
        from diffbotctl.ui.map import Map

        self.rest()
        seen = [(0.0, 0.0), *(point for points in drawing.points.values() for point in points)]
        chart = Map(WIDTH, HEIGHT, seen, least=FINEST)
        chart.mark((0.0, 0.0), "┼", "bold")
        legend = []
        for number, (kind, points) in enumerate(drawing.points.items()):
            sign, style = SIGNS[number % len(SIGNS)], STYLES[number % len(STYLES)]
            legend.append(f"{sign} {kind}")
            for point in points:
                chart.mark(point, sign, style)
        self.console.print(f"{drawing.title}   ({', '.join(legend)})", markup=False)
        self.console.print(chart.text())

    def rest(self) -> None:
        """Take the bar away."""
        if self.bar is not None:
            self.bar.stop()
            self.bar = None
