"""A chart of numbers over time in braille dots, or in letters without UTF-8."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from rich.text import Text

from diffbotctl.ui.dots import BRAILLE

STYLES = ("cyan", "yellow", "magenta", "green", "red", "blue")
LETTERS = "*+xo#@"
LABEL = 9  # characters for the numbers on the left

Series = Sequence[tuple[float, float]]


def chart(
    series: Sequence[tuple[str, Series]], span: float, width: int, height: int, plain: bool = False
) -> Text:
    """The last `span` seconds of each named series of (time, value), on one scale.

    `height` lines in all, the last ones with the names.
    """
    rows, columns = max(height - max(len(series), 1), 2), max(width - LABEL, 4)
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
        out.append(f"{_number(label):>{LABEL - 1}} ", "dim")
        for column in range(columns):
            bits, number = cells.get((row, column), (0, 0))
            sign = LETTERS[number % len(LETTERS)] if plain else BRAILLE.character(bits)
            out.append(sign if bits else " ", STYLES[number % len(STYLES)] if bits else None)
        out.append("\n")
    for number, (name, known) in enumerate(series):
        sign = LETTERS[number % len(LETTERS)] if plain else "━"
        last = _number(known[-1][1]) if known else "nothing yet"
        out.append(f"{last:>{LABEL - 1}} {sign} {name}", STYLES[number % len(STYLES)])
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
