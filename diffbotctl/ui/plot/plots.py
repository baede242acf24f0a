"""A chart of numbers over time in braille dots, or in letters without UTF-8.

Points of a curve, in characters, with both axes' numbers.

Points around an origin, in characters, with a scale in mm.

Curves in a terminal: one panel a field, one below the other, over one axis of time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from math import isfinite, isnan

from rich.text import Text

from diffbotctl.recording.fields import Series
from diffbotctl.ui.plot.axes import Axis, make_axis
from diffbotctl.ui.plot.canvas import BRAILLE, DotCanvas, DotFont

CHART_STYLES = ("cyan", "yellow", "magenta", "green", "red", "blue")
LETTERS = "*+xo#@"
CHART_LABEL_WIDTH = 9  # characters for the numbers on the left

ChartSeries = Sequence[tuple[float, float]]


def render_chart(
    series: Sequence[tuple[str, ChartSeries]],
    span: float,
    width: int,
    height: int,
    plain: bool = False,
) -> Text:
    """The last `span` seconds of each named series of (time, value), on one scale.

    `height` lines in all, the last ones with the names.
    """
    rows, columns = max(height - max(len(series), 1), 2), max(width - CHART_LABEL_WIDTH, 4)
    end = max((points[-1][0] for _, points in series if points), default=0.0)
    shown = [[(t, v) for t, v in points if t >= end - span and isfinite(v)] for _, points in series]
    low, high = _limits([v for points in shown for _, v in points])
    cells: dict[tuple[int, int], tuple[int, int]] = {}
    for number, points in enumerate(shown):
        for time, value in points:
            across = round((time - end + span) / span * (columns * 2 - 1))
            down = round((high - value) / (high - low) * (rows * 4 - 1))
            cell = (down // 4, across // 2)
            bits = cells.get(cell, (0, number))[0] | BRAILLE.bits[across % 2][down % 4]
            cells[cell] = (bits, number)
    out = Text(no_wrap=True, end="")
    for row in range(rows):
        label = high if row == 0 else low if row == rows - 1 else None
        out.append(f"{_number(label):>{CHART_LABEL_WIDTH - 1}} ", "dim")
        for column in range(columns):
            bits, number = cells.get((row, column), (0, 0))
            sign = LETTERS[number % len(LETTERS)] if plain else BRAILLE.character(bits)
            out.append(
                sign if bits else " ", CHART_STYLES[number % len(CHART_STYLES)] if bits else None
            )
        out.append("\n")
    for number, (name, known) in enumerate(series):
        sign = LETTERS[number % len(LETTERS)] if plain else "━"
        last = _number(known[-1][1]) if known else "nothing yet"
        out.append(
            f"{last:>{CHART_LABEL_WIDTH - 1}} {sign} {name}",
            CHART_STYLES[number % len(CHART_STYLES)],
        )
        out.append("\n" if number + 1 < len(series) else "")
    return out


def _limits(values: Sequence[float]) -> tuple[float, float]:
    if not values:
        return 0.0, 1.0
    low, high = min(values), max(values)
    if high - low < 1e-9:
        margin = abs(high) * 0.1 or 1.0
        return low - margin, high + margin
    return low, high


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


CURVE_WIDTH, CURVE_HEIGHT = 60, 16  # characters
CURVE_LABEL_WIDTH = 7  # characters for the numbers on the left
CURVE_SIGNS = ".ox+"
CURVE_STYLES = ("dim", "bold blue", "red", "green")

CurvePoint = tuple[float, float]


def render_curve(points: Mapping[str, Sequence[CurvePoint]], across: str, upwards: str) -> Text:
    """Points by their kind, later kinds over earlier ones; axes from the least to the most."""
    every = [point for many in points.values() for point in many]
    left, right = _span([x for x, _ in every])
    low, high = _span([y for _, y in every])
    cells: dict[tuple[int, int], int] = {}
    for kind, many in enumerate(points.values()):
        for x, y in many:
            column = round((x - left) / (right - left) * (CURVE_WIDTH - 1))
            row = round((high - y) / (high - low) * (CURVE_HEIGHT - 1))
            cells[(column, row)] = kind
    out = Text(no_wrap=True)
    for row in range(CURVE_HEIGHT):
        label = {0: f"{high:.3g}", CURVE_HEIGHT - 1: f"{low:.3g}"}.get(row, "")
        out.append(f"{label:>{CURVE_LABEL_WIDTH}} |")
        for column in range(CURVE_WIDTH):
            kind_here = cells.get((column, row))
            if kind_here is None:
                out.append(" ")
            else:
                out.append(
                    CURVE_SIGNS[kind_here % len(CURVE_SIGNS)],
                    CURVE_STYLES[kind_here % len(CURVE_STYLES)],
                )
        out.append("\n")
    out.append(f"{'':>{CURVE_LABEL_WIDTH}} +{'-' * CURVE_WIDTH}\n")
    far = f"{right:.3g}"
    out.append(f"{'':>{CURVE_LABEL_WIDTH}}  {f'{left:.3g}':<{CURVE_WIDTH - len(far)}}{far}\n")
    legend = ", ".join(
        f"{CURVE_SIGNS[n % len(CURVE_SIGNS)]} {kind}" for n, kind in enumerate(points)
    )
    out.append(f"{legend}; across {across}, upwards {upwards}")
    return out


def _span(values: Sequence[float]) -> CurvePoint:
    """The least and the most, apart."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    return (low, high) if high > low else (low, low + 1.0)


SCATTER_WIDTH, SCATTER_HEIGHT = 61, 21  # characters, odd so that the origin has one of its own
ASPECT = 2.0  # a character is about twice as high as it is wide
FINEST = 0.005  # m from the middle to the edge at least
SCATTER_SIGNS = "ox+*"
SCATTER_STYLES = ("red", "green", "bold blue", "magenta")
MM = 1000.0

ScatterPoint = tuple[float, float]


def render_scatter(points: Mapping[str, Sequence[ScatterPoint]]) -> Text:
    """Points (m) by their kind; x to the right, y upwards, the origin in the middle."""
    reach = max([FINEST, *(_reach(point) for many in points.values() for point in many)])
    cells = _axes()
    for number, many in enumerate(points.values()):
        mark = (
            SCATTER_SIGNS[number % len(SCATTER_SIGNS)],
            SCATTER_STYLES[number % len(SCATTER_STYLES)],
        )
        for point in many:
            cells[_cell(point, reach)] = mark
    out = Text(no_wrap=True)
    for row in range(SCATTER_HEIGHT):
        for column in range(SCATTER_WIDTH):
            sign, style = cells.get((column, row), (" ", ""))
            out.append(sign, style or None)
        out.append("\n")
    legend = ", ".join(
        f"{SCATTER_SIGNS[n % len(SCATTER_SIGNS)]} {kind}" for n, kind in enumerate(points)
    )
    out.append(f"{legend}; from the middle to the upper edge {reach * MM:.0f} mm")
    return out


def _reach(point: ScatterPoint) -> float:
    """How far the picture must reach upwards for `point` to be in it."""
    return max(abs(point[0]) * SCATTER_HEIGHT * ASPECT / SCATTER_WIDTH, abs(point[1]))


def _cell(point: ScatterPoint, reach: float) -> tuple[int, int]:
    scale = (SCATTER_HEIGHT // 2) / reach  # rows a metre
    return SCATTER_WIDTH // 2 + round(point[0] * scale * ASPECT), SCATTER_HEIGHT // 2 - round(
        point[1] * scale
    )


def _axes() -> dict[tuple[int, int], tuple[str, str]]:
    middle = (SCATTER_WIDTH // 2, SCATTER_HEIGHT // 2)
    cells = {(column, middle[1]): ("-", "dim") for column in range(SCATTER_WIDTH)}
    cells.update({(middle[0], row): ("|", "dim") for row in range(SCATTER_HEIGHT)})
    cells[middle] = ("+", "dim")
    return cells


LEAST = 3  # rows of a panel below which its curve cannot be told
MARGIN = 10  # columns for the numbers at the left, with the line that parts them from the curve
TICK_EVERY = 4  # rows between two numbers at the left
COLUMNS_A_TICK = 14  # columns between two numbers on the axis of time


def render_plots(
    drawn: Sequence[Series], width: int = 80, height: int = 24, font: DotFont = BRAILLE
) -> Iterator[str]:
    """The picture as lines of at most `width` columns, in `height` rows if the panels fit."""
    room = (height - 2) // len(drawn) - 1  # below all: time and its unit; above each: its name
    rows = max(room, LEAST)
    columns = width - MARGIN
    begin = min(each.times[0] for each in drawn)
    end = max(each.times[-1] for each in drawn)
    time = make_axis(begin, end, max(columns // COLUMNS_A_TICK, 1))
    for each in drawn:
        yield from _panel(each, time, columns, rows, font)
    yield from _time(time, columns, font)


def _panel(each: Series, time: Axis, columns: int, rows: int, font: DotFont) -> Iterator[str]:
    values = make_axis(*each.bounds(), max(rows // TICK_EVERY, 1))
    canvas = DotCanvas(columns, rows, font)
    points = [(_place(time, t, canvas.width), _row(values, v, canvas)) for t, v in _pairs(each)]
    for (x0, y0), (x1, y1) in pairwise(points):
        if y0 is not None and y1 is not None:
            canvas.line(x0, y0, x1, y1)
        elif y1 is not None:
            canvas.set(x1, y1)
    if points and points[0][1] is not None:
        canvas.set(points[0][0], points[0][1])
    unit = f" [{each.unit}]" if each.unit else ""
    yield f"{each.name}{unit}"[: columns + MARGIN]
    labels = {_label_row(values, tick, rows): values.label(tick) for tick in values.ticks}
    bar = "\N{BOX DRAWINGS LIGHT VERTICAL}" if font is BRAILLE else "|"
    for number, text in enumerate(canvas.rows()):
        yield f"{labels.get(number, ''):>{MARGIN - 2}} {bar}{text}".rstrip()


def _pairs(each: Series) -> Iterator[tuple[float, float]]:
    return zip(each.times, each.values, strict=True)


def _place(time: Axis, value: float, width: int) -> int:
    return round(time.share(value) * (width - 1))


def _row(values: Axis, value: float, canvas: DotCanvas) -> int | None:
    return None if isnan(value) else round((1.0 - values.share(value)) * (canvas.height - 1))


def _label_row(values: Axis, value: float, rows: int) -> int:
    return round((1.0 - values.share(value)) * (rows - 1))


def _time(time: Axis, columns: int, font: DotFont) -> Iterator[str]:
    corner, dash, mark = "\u2514\u2500\u2534" if font is BRAILLE else "+-+"  # box drawing
    ruler, labels = [dash] * columns, [" "] * columns
    for tick in time.ticks:
        at = _place(time, tick, columns)
        text = time.label(tick) + (" s" if tick == time.ticks[-1] else "")
        begin = min(max(at - len(text) // 2, 0), columns - len(text))
        if any(character != " " for character in labels[max(begin - 1, 0) : begin + len(text)]):
            continue  # no room beside the number before it
        ruler[at] = mark
        labels[begin : begin + len(text)] = text
    yield " " * (MARGIN - 1) + corner + "".join(ruler)
    yield (" " * MARGIN + "".join(labels)).rstrip()
