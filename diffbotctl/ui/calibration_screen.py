"""Draws the steps of a calibration: lines, a bar, pictures of points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.calibrate.step import CurvePlot, ScatterPlot
    from diffbotctl.calibrate.step import StepProgress as Done


class CalibrationScreen:
    """A terminal; without one, plain lines and no bar."""

    def __init__(self, console: Console | None = None) -> None:
        self.console = console or Console(highlight=False)
        self.bar: Progress | None = None

    def say(self, text: str) -> None:
        """A line, below a bar that is finished with it."""
        self.rest()
        self.console.print(fold_text(text), markup=False, soft_wrap=True)

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

    def draw(self, drawing: ScatterPlot | CurvePlot) -> None:
        """Points around the origin, or along a curve, each kind by its own sign."""
        from diffbotctl.calibrate.step import CurvePlot
        from diffbotctl.ui.plot.plots import render_curve, render_scatter

        self.rest()
        self.console.print(drawing.title, markup=False)
        if isinstance(drawing, CurvePlot):
            self.console.print(render_curve(drawing.points, drawing.across, drawing.upwards))
        else:
            self.console.print(render_scatter(drawing.points))

    def rest(self) -> None:
        """Take the bar away."""
        if self.bar is not None:
            self.bar.stop()
            self.bar = None
