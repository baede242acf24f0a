"""A robot's drawing in characters, on the same dots as the map."""

from __future__ import annotations

from rich.text import Text

from diffbotctl.render.robot_views import DrawingView
from diffbotctl.ui.map.canvas import Layer, Map
from diffbotctl.ui.map.viewport import ACROSS, DOWN, Camera

WIDEST = 72  # characters; a robot drawn wider is no clearer
HIGHEST = 22  # lines; both views then fit on most terminals
BORDER = 6  # dots that are kept free at the sides


def portrait(view: DrawingView, width: int) -> Text:
    """`view` within `width` characters: its title, the drawing, and its lengths."""
    points = [point for outline in view.outlines for point in outline.points]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    wide, high = max(xs) - min(xs), max(ys) - min(ys)
    across = min(width - 2, WIDEST)
    scale = min((across * ACROSS - BORDER) / wide, (HIGHEST * DOWN - BORDER) / high)
    rows = int(high * scale / DOWN) + 2
    camera = Camera((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2, scale)
    drawing = Map(camera, across, rows)
    for outline in view.outlines:
        line = outline.points + outline.points[:1] if outline.closed else outline.points
        drawing.lines(line, Layer.SCAN if outline.colour == "red" else Layer.TRAIL)
    lengths = ", ".join(dimension.label for dimension in view.dimensions)
    return Text.assemble((f"{view.title}: ", "bold"), lengths, "\n", drawing.text())
