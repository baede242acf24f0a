"""Plots in the terminal: a curve, a scatter plot, and panels over a time axis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from math import isnan

from rich.text import Text

from diffbotctl.recording.fields import Series
from diffbotctl.ui.plot.axes import Axis, make_axis
from diffbotctl.ui.plot.canvas import BRAILLE, CharacterCanvas, DotFont

Point = tuple[float, float]

CURVE_WIDTH, CURVE_HEIGHT = 60, 16  # characters
CURVE_LABEL_WIDTH = 7  # characters for the numbers on the left
CURVE_SIGNS = ".ox+"
CURVE_STYLES = ("dim", "bold blue", "red", "green")


def render_curve(points: Mapping[str, Sequence[Point]], across: str, upwards: str) -> Text:
    """Points by their kind, later kinds over earlier ones, on axes from minimum to maximum."""
    all_points = [point for group in points.values() for point in group]
    left, right = _curve_limits([x for x, _ in all_points])
    low, high = _curve_limits([y for _, y in all_points])
    canvas = CharacterCanvas(CURVE_WIDTH, CURVE_HEIGHT)
    for group, sign, style in zip(
        points.values(), cycle(CURVE_SIGNS), cycle(CURVE_STYLES), strict=False
    ):
        for x, y in group:
            column = round((x - left) / (right - left) * (CURVE_WIDTH - 1))
            row = round((high - y) / (high - low) * (CURVE_HEIGHT - 1))
            canvas.put(column, row, sign, style)
    out = Text(no_wrap=True)
    labels = {0: f"{high:.3g}", CURVE_HEIGHT - 1: f"{low:.3g}"}
    for row in range(CURVE_HEIGHT):
        out.append(f"{labels.get(row, ''):>{CURVE_LABEL_WIDTH}} |").append(canvas.row(row))
        out.append("\n")
    margin, end = " " * CURVE_LABEL_WIDTH, f"{right:.3g}"
    out.append(f"{margin} +{'-' * CURVE_WIDTH}\n")
    out.append(f"{margin}  {f'{left:.3g}':<{CURVE_WIDTH - len(end)}}{end}\n")
    return out.append(f"{_legend(points, CURVE_SIGNS)}; across {across}, upwards {upwards}")


def _curve_limits(values: Sequence[float]) -> Point:
    """The least and the greatest value, apart."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    return (low, high) if high > low else (low, low + 1.0)


def _legend(kinds: Mapping[str, object], signs: str) -> str:
    return ", ".join(f"{sign} {kind}" for kind, sign in zip(kinds, cycle(signs), strict=False))


SCATTER_WIDTH, SCATTER_HEIGHT = 61, 21  # characters; odd, so that the origin is a character
CHARACTER_ASPECT = 2.0  # a character is about twice as high as it is wide
SCATTER_RANGE_MIN_M = 0.005  # from the middle to the edge
SCATTER_SIGNS = "ox+*"
SCATTER_STYLES = ("red", "green", "bold blue", "magenta")


def render_scatter(points: Mapping[str, Sequence[Point]]) -> Text:
    """Points (m) by their kind; x to the right, y upwards, the origin in the middle."""
    middle_column, middle_row = SCATTER_WIDTH // 2, SCATTER_HEIGHT // 2
    aspect = SCATTER_HEIGHT * CHARACTER_ASPECT / SCATTER_WIDTH
    extents = [max(abs(x) * aspect, abs(y)) for group in points.values() for x, y in group]
    extent = max([SCATTER_RANGE_MIN_M, *extents])
    scale = middle_row / extent  # rows a metre
    canvas = CharacterCanvas(SCATTER_WIDTH, SCATTER_HEIGHT)
    for column in range(SCATTER_WIDTH):
        canvas.put(column, middle_row, "-", "dim")
    for row in range(SCATTER_HEIGHT):
        canvas.put(middle_column, row, "|", "dim")
    canvas.put(middle_column, middle_row, "+", "dim")
    for group, sign, style in zip(
        points.values(), cycle(SCATTER_SIGNS), cycle(SCATTER_STYLES), strict=False
    ):
        for x, y in group:
            column = middle_column + round(x * scale * CHARACTER_ASPECT)
            canvas.put(column, middle_row - round(y * scale), sign, style)
    legend = _legend(points, SCATTER_SIGNS)
    note = f"\n{legend}; from the middle to the upper edge {extent * 1000:.0f} mm"
    out = canvas.text().append(note)
    out.end = "\n"
    return out


PANEL_MIN_ROWS = 3  # a curve in fewer rows is not readable
PANEL_LABEL_WIDTH = 10  # columns for the numbers on the left and the line beside the curve
ROWS_PER_TICK = 4  # rows between two numbers on the left
COLUMNS_PER_TICK = 14  # columns between two numbers on the time axis


def render_plots(
    plotted: Sequence[Series], width: int = 80, height: int = 24, font: DotFont = BRAILLE
) -> Iterator[str]:
    """A panel for each series, over one time axis, as lines of at most `width` columns, or of 24.

    `height` rows in total if the panels fit.
    """
    available = (height - 2) // len(plotted) - 1  # below all: time and its unit; above each: name
    columns = max(width - PANEL_LABEL_WIDTH, COLUMNS_PER_TICK)
    begin = min(series.times[0] for series in plotted)
    end = max(series.times[-1] for series in plotted)
    time = make_axis(begin, end, max(columns // COLUMNS_PER_TICK, 1))
    for series in plotted:
        yield from _panel(series, time, columns, max(available, PANEL_MIN_ROWS), font)
    yield from time_axis_lines(time, columns, font)


def _panel(series: Series, time: Axis, columns: int, rows: int, font: DotFont) -> Iterator[str]:
    values = make_axis(*series.bounds(), max(rows // ROWS_PER_TICK, 1))
    canvas = CharacterCanvas(columns, rows, font)
    canvas.polyline(
        None
        if isnan(value)
        else (time.position(at, canvas.dot_width), values.position(value, canvas.dot_height, True))
        for at, value in zip(series.times, series.values, strict=True)
    )
    unit = f" [{series.unit}]" if series.unit else ""
    yield f"{series.name}{unit}"[: columns + PANEL_LABEL_WIDTH]
    labels = {values.position(tick, rows, True): values.label(tick) for tick in values.ticks}
    bar = "\N{BOX DRAWINGS LIGHT VERTICAL}" if font is BRAILLE else "|"
    for row in range(rows):
        yield f"{labels.get(row, ''):>{PANEL_LABEL_WIDTH - 2}} {bar}{canvas.row(row)}".rstrip()


def time_axis_lines(time: Axis, columns: int, font: DotFont) -> Iterator[str]:
    """A ruler of `columns` characters below panels, and its times in s."""
    corner, dash, mark = "\u2514\u2500\u2534" if font is BRAILLE else "+-+"  # box drawing
    ruler, labels = [dash] * columns, [" "] * columns
    for tick in time.ticks:
        column = time.position(tick, columns)
        text = time.label(tick) + (" s" if tick == time.ticks[-1] else "")
        begin = min(max(column - len(text) // 2, 0), columns - len(text))
        if any(character != " " for character in labels[max(begin - 1, 0) : begin + len(text)]):
            continue  # it would overlap the number before it
        ruler[column] = mark
        labels[begin : begin + len(text)] = text
    yield " " * (PANEL_LABEL_WIDTH - 1) + corner + "".join(ruler)
    yield (" " * PANEL_LABEL_WIDTH + "".join(labels)).rstrip()
