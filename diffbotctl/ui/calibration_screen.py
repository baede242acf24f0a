"""Draws the steps of a calibration: lines, a bar, pictures of points.

A fitted geometry as lines of text.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.calibrate.geometry_fit import GeometryFit
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


MM = 1000.0  # mm in a m


def fit_report(fit: GeometryFit) -> Iterator[str]:
    """What was found, what was used, and how far each drive ends off before and after."""
    yield from _mistakes(fit)
    yield f"{'':<24} {'stated':>10} {'fitted':>10}   95 % confidence"
    sure, found, stated = fit.confidence, fit.geometry, fit.stated
    rows = (
        ("right wheel diameter", stated.right, found.right, sure.right.half),
        ("left wheel diameter", stated.left, found.left, sure.left.half),
        ("track", stated.track, found.track, sure.track.half),
    )
    for name, before, after, half in rows:
        error = f"+- {MM * after * half:.3f} mm ({100 * half:.2f} %)"
        yield f"{name:<24} {MM * before:>7.3f} mm {MM * after:>7.3f} mm   {error}"
    half = sure.ratio.half
    ratios = f"{stated.ratio:>10.5f} {found.ratio:>10.5f}"
    yield f"{'right over left':<24} {ratios}   +- {found.ratio * half:.5f} ({100 * half:.3f} %)"
    yield ""
    yield from _drives(fit)


def _mistakes(fit: GeometryFit) -> Iterator[str]:
    """What the user should know before the figures."""
    said = []
    if fit.swapped:
        said.append("The columns of the wheels are swapped: left is right. Taken the right way.")
    if fit.times_track == 2:
        said.append("The stated track is half the true one: measure from tyre to tyre.")
    elif fit.times_track != 1:
        said.append("The stated track is twice the true one: measure from tyre to tyre once.")
    if not fit.sees_diameter:
        said.append("These drives do not tell the mean wheel diameter: it is kept as stated.")
    if len(fit.drives) == 1:
        said.append("One drive alone: nothing shows how the next would differ.")
    yield from said
    if said:
        yield ""


def _drives(fit: GeometryFit) -> Iterator[str]:
    from diffbotctl.calibrate.dead_reckoning import end_error

    yield f"{'drive':<32} {'ended off by':>13} {'now by':>10} {'clock':>9}"
    for drive, offset in zip(fit.drives, fit.offsets, strict=True):
        before, after = (end_error(drive, each) for each in (fit.stated, fit.geometry))
        off = f"{MM * hypot(before.x, before.y):>10.1f} mm {MM * hypot(after.x, after.y):>7.1f} mm"
        yield f"{drive.name:<32} {off} {MM * offset:>+6.0f} ms"
    for stray in fit.strays:
        yield f"{stray.name:<32} left out: {stray.times:.0f} times as far off as the others"
