"""Output of calibrations on a terminal: lines, a progress bar, plots, the report of a fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import hypot
from typing import TYPE_CHECKING

from rich.progress import (
    BarColumn,
    Progress,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text as StyledText

from diffbotctl.calibrate.step import CurvePlot
from diffbotctl.errors import WIDTH
from diffbotctl.ui.console import PrintableConsole
from diffbotctl.ui.plot.plots import render_curve, render_scatter
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.calibrate.geometry_fit import GeometryFit
    from diffbotctl.calibrate.simulated_truth import ComparedValue
    from diffbotctl.calibrate.step import CurvePlot, ScatterPlot, StepProgress

SPEED_ESTIMATE_S = 600.0  # of the past from which the time left is estimated: some drives


class RemainingColumn(TimeRemainingColumn):
    """The time that is left, and nothing while it is not known."""

    def render(self, task: Task) -> StyledText:
        """`0:00:12 left`."""
        if task.time_remaining is None:
            return StyledText("")
        return super().render(task).append(" left")


class CalibrationScreen:
    """A terminal; without one, plain lines and no bar."""

    def __init__(self, console: PrintableConsole | None = None) -> None:
        self.console = console or PrintableConsole(highlight=False)
        self.bar: Progress | None = None

    def say(self, text: str) -> None:
        """Print a line; the bar is removed."""
        self.rest()
        folded = fold_text(text, width=min(WIDTH, self.console.width))
        self.console.print(folded, markup=False, soft_wrap=True)

    def progress(self, progress: StepProgress) -> None:
        if not self.console.is_terminal:
            return
        if self.bar is None:
            columns = (
                TextColumn("{task.description}"),
                BarColumn(),
                TimeElapsedColumn(),
                RemainingColumn(),
            )
            self.bar = Progress(
                *columns,
                console=self.console,
                transient=True,
                speed_estimate_period=SPEED_ESTIMATE_S,
            )
            self.bar.start()
            self.bar.add_task(progress.what, total=progress.total)
        self.bar.update(
            self.bar.task_ids[0],
            description=progress.what,
            completed=progress.done,
            total=progress.total,
        )

    def draw(self, plot: ScatterPlot | CurvePlot) -> None:
        """Draw points around the origin, or along a curve, each kind with its own sign."""
        self.rest()
        self.console.print(plot.title, markup=False)
        if isinstance(plot, CurvePlot):
            self.console.print(render_curve(plot.points, plot.x_unit, plot.y_unit))
        else:
            self.console.print(render_scatter(plot.points))

    def rest(self) -> None:
        if self.bar is not None:
            self.bar.stop()
            self.bar = None


MM = 1000.0  # mm in a m


def truth_report(values: Sequence[ComparedValue]) -> Iterator[str]:
    """The calibrated values of a simulated robot beside the true ones; nothing if none has a true
    value, as a wiring has not."""
    if not values:
        return
    yield "SIMULATED: what was found, and the truth"
    yield f"{'':<32} {'found':>10} {'truth':>10} {'error':>10}  in sd"
    for value in values:
        scale, unit = (MM, "mm") if value.unit == "m" else (1.0, value.unit)
        numbers = (value.found, value.true, value.found - value.true)
        columns = " ".join(f"{scale * number:>10.5g}" for number in numbers[:2])
        deviation = "" if value.deviation is None else f"{value.deviation:+6.1f}"
        error = f"{scale * numbers[2]:>+10.2g}"
        yield f"{value.field:<32} {columns} {error} {deviation:>6}  {unit if unit != '1' else ''}"


def fit_report(fit: GeometryFit) -> Iterator[str]:
    """The fitted geometry beside the stated one, and the end error of each drive with both."""
    if notes := list(_notes(fit)):
        yield from (*notes, "")
    yield f"{'':<24} {'stated':>10} {'fitted':>10}   95 % confidence"
    confidence, fitted, stated = fit.confidence, fit.geometry, fit.stated
    for name, before, after, half in (
        ("right wheel diameter", stated.right, fitted.right, confidence.right.half_width),
        ("left wheel diameter", stated.left, fitted.left, confidence.left.half_width),
        ("track", stated.track, fitted.track, confidence.track.half_width),
    ):
        error = f"+- {MM * after * half:.3f} mm ({100 * half:.2f} %)"
        yield f"{name:<24} {MM * before:>7.3f} mm {MM * after:>7.3f} mm   {error}"
    half = confidence.ratio.half_width
    ratios = f"{stated.ratio:>10.5f} {fitted.ratio:>10.5f}"
    yield f"{'right over left':<24} {ratios}   +- {fitted.ratio * half:.5f} ({100 * half:.3f} %)"
    half, before, after = (
        confidence.track_over_mean.half_width,
        stated.track / stated.mean,
        fitted.track / fitted.mean,
    )
    name = "track over mean diameter"
    yield f"{name:<24} {before:>10.5f} {after:>10.5f}   +- {after * half:.5f} ({100 * half:.3f} %)"
    yield ""
    yield from _drives(fit)


def _notes(fit: GeometryFit) -> Iterator[str]:
    """What the user should know before the figures."""
    if not fit.sees_diameter:
        yield "These drives do not determine the mean wheel diameter: it is kept as stated, and all"
        yield "lengths are as uncertain as it is; `diffbotctl calibrate distance` measures it."
    if len(fit.drives) == 1:
        yield "Only one drive: its repeatability is unknown."


def _drives(fit: GeometryFit) -> Iterator[str]:
    # Imported late: it imports numpy, which takes long.
    from diffbotctl.calibrate.dead_reckoning import end_error

    yield f"{'drive':<32} {'error before':>13} {'after':>10} {'clock':>9}"
    for drive, offset in zip(fit.drives, fit.offsets, strict=True):
        stated, fitted = end_error(drive, fit.stated), end_error(drive, fit.geometry)
        before, after = MM * hypot(stated.x, stated.y), MM * hypot(fitted.x, fitted.y)
        errors = f"{before:>10.1f} mm {after:>7.1f} mm"
        yield f"{drive.name:<32} {errors} {MM * offset:>+6.0f} ms"
    for outlier in fit.outliers:
        yield f"{outlier.name:<32} left out: {outlier.ratio:.0f} times the error of the others"
