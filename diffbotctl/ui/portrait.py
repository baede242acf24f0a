"""A robot's drawing in characters, on the same dots as the map."""

from __future__ import annotations

from itertools import pairwise

from rich.text import Text

from diffbotctl.model.drawing import View
from diffbotctl.ui.map import Map

WIDEST = 72  # characters; a robot drawn wider is no clearer
DOTS_ACROSS, DOTS_DOWN = 2, 4  # of one character
BORDER = 6  # dots that a map keeps free at its sides


def portrait(view: View, width: int) -> Text:
    """`view` within `width` characters: its title, the drawing, and its lengths."""
    points = [point for outline in view.outlines for point in outline.points]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    wide, high = max(xs) - min(xs), max(ys) - min(ys)
    across = min(width - 2, WIDEST)
    scale = (across * DOTS_ACROSS - BORDER) / wide
    rows = int(high * scale / DOTS_DOWN) + 2
    drawing = Map(across, rows, points, least=wide)
    for outline in view.outlines:
        line = outline.points + outline.points[:1] if outline.closed else outline.points
        for start, end in pairwise(line):
            drawing.line(start, end)
    lengths = ", ".join(dimension.label for dimension in view.dimensions)
    return Text.assemble((f"{view.title}: ", "bold"), lengths, "\n", drawing.text())
