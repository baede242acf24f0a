"""Curves in a terminal: one panel a field, one below the other, over one axis of time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import isnan

from diffbotctl.bags.series import Series
from diffbotctl.ui.axis import Axis, axis
from diffbotctl.ui.dots import BRAILLE, Dots, Font

LEAST = 3  # rows of a panel below which its curve cannot be told
MARGIN = 10  # columns for the numbers at the left, with the line that parts them from the curve
TICK_EVERY = 4  # rows between two numbers at the left
COLUMNS_A_TICK = 14  # columns between two numbers on the axis of time


def lines(
    drawn: Sequence[Series], width: int = 80, height: int = 24, font: Font = BRAILLE
) -> Iterator[str]:
    """The picture as lines of at most `width` columns, in `height` rows if the panels fit."""
    room = (height - 2) // len(drawn) - 1  # below all: time and its unit; above each: its name
    rows = max(room, LEAST)
    columns = width - MARGIN
    begin = min(each.times[0] for each in drawn)
    end = max(each.times[-1] for each in drawn)
    time = axis(begin, end, max(columns // COLUMNS_A_TICK, 1))
    for each in drawn:
        yield from _panel(each, time, columns, rows, font)
    yield from _time(time, columns, font)


def _panel(each: Series, time: Axis, columns: int, rows: int, font: Font) -> Iterator[str]:
    values = axis(*each.bounds(), max(rows // TICK_EVERY, 1))
    canvas = Dots(columns, rows, font)
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


def _row(values: Axis, value: float, canvas: Dots) -> int | None:
    return None if isnan(value) else round((1.0 - values.share(value)) * (canvas.height - 1))


def _label_row(values: Axis, value: float, rows: int) -> int:
    return round((1.0 - values.share(value)) * (rows - 1))


def _time(time: Axis, columns: int, font: Font) -> Iterator[str]:
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
