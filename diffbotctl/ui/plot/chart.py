"""The live chart: fields over the last seconds, a panel for each unit, one time axis below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from math import isfinite
from typing import NamedTuple

from rich.text import Text

from diffbotctl.ui.plot.axes import Axis, make_axis
from diffbotctl.ui.plot.canvas import ASCII, BRAILLE, CharacterCanvas
from diffbotctl.ui.plot.plots import (
    COLUMNS_PER_TICK,
    PANEL_LABEL_WIDTH,
    ROWS_PER_TICK,
    Point,
    time_axis_lines,
)

STYLES = ("cyan", "yellow", "magenta", "green", "red", "blue")
LETTERS = "*+xo#@"
TIME_AXIS_ROWS = 2
PANEL_MIN_ROWS = 2


class ChartCurve(NamedTuple):
    """A field with its unit and its samples (s, value), the oldest first."""

    name: str
    unit: str
    points: Sequence[Point]


class _Line(NamedTuple):
    """A curve as it is drawn."""

    curve: ChartCurve
    letter: str
    style: str
    shown: list[Point]  # of the time axis, without what is no number


def render_chart(
    curves: Sequence[ChartCurve], span: float, width: int, height: int, plain: bool = False
) -> Text:
    """The last `span` seconds in `width` columns and, where the panels fit, `height` rows.

    Curves of one unit share a panel and its scale. `plain`: letters in place of braille.
    """
    end = max((curve.points[-1][0] for curve in curves if curve.points), default=0.0)
    begin = max(end - span, 0.0)
    columns = max(width - PANEL_LABEL_WIDTH, COLUMNS_PER_TICK)
    time = make_axis(begin, begin + span, max(columns // COLUMNS_PER_TICK, 1))
    panels: dict[str, list[_Line]] = {}
    for number, curve in enumerate(curves):
        shown = [(at, value) for at, value in curve.points if at >= begin and isfinite(value)]
        letter, style = LETTERS[number % len(LETTERS)], STYLES[number % len(STYLES)]
        panels.setdefault(curve.unit, []).append(_Line(curve, letter, style, shown))
    legends = [list(_legend(lines, width, plain)) for lines in panels.values()]
    free = height - TIME_AXIS_ROWS - sum(map(len, legends))
    rows = max(free // max(len(panels), 1), PANEL_MIN_ROWS)
    pictures = (_panel(lines, time, columns, rows, plain) for lines in panels.values())
    parts = chain.from_iterable(
        chain(legend, picture) for legend, picture in zip(legends, pictures, strict=True)
    )
    font = ASCII if plain else BRAILLE
    axis = (Text(line, "dim") for line in time_axis_lines(time, columns, font))
    return Text("\n", no_wrap=True, end="").join(chain(parts, axis))


def _legend(lines: list[_Line], width: int, plain: bool) -> Iterator[Text]:
    """Sign, name, newest value and unit of each curve, as many on a line as fit."""
    row = Text()
    for curve, letter, style, _ in lines:
        value = f"{curve.points[-1][1]:.4g}" if curve.points else "no data"
        text = f"{letter if plain else '━'} {curve.name} {value} {curve.unit}".rstrip()
        if row and len(row) + 2 + len(text) > width:
            yield row
            row = Text()
        row.append("  " if row else "").append(text, style)
    yield row


def _panel(lines: list[_Line], time: Axis, columns: int, rows: int, plain: bool) -> Iterator[Text]:
    """The curves of one unit on one scale."""
    values = [value for line in lines for _, value in line.shown]
    scale = make_axis(
        min(values, default=0.0), max(values, default=1.0), max(rows // ROWS_PER_TICK, 1)
    )
    canvas = CharacterCanvas(columns, rows)
    for _, letter, style, shown in lines:
        dots = [
            (
                time.position(at, canvas.dot_width),
                scale.position(value, canvas.dot_height, True),
            )
            for at, value in shown
        ]
        if not plain:
            canvas.polyline(dots, style)
            continue
        for x, y in dots:
            canvas.put(x // BRAILLE.across, y // BRAILLE.down, letter, style)
    labels = {scale.position(tick, rows, True): scale.label(tick) for tick in scale.ticks}
    bar = "|" if plain else "│"
    for row in range(rows):
        label = f"{labels.get(row, ''):>{PANEL_LABEL_WIDTH - 2}} {bar}"
        yield Text.assemble((label, "dim"), canvas.row(row))
