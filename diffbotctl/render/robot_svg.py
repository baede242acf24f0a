"""Views of a robot as one SVG picture, drawn to scale, with their lengths."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple
from xml.sax.saxutils import escape

from diffbotctl.render.robot_views import Dimension, DrawingOutline, DrawingView, Point
from diffbotctl.render.svg import document, mark, points, words

WIDTH = 640.0  # px of the wider view; enough to read every length
MARGIN = 70.0  # px around a view, where its lengths are written
TEXT = 14.0  # px
FILLS = {"blue": "#cfe0f7", "black": "#9a9a9a", "grey": "#dddddd", "red": "#f4b6b6"}


class DrawingSheet(NamedTuple):
    """Where a view lies on the paper: px a metre, and the paper's place of (0, 0)."""

    scale: float
    x: float
    y: float

    def place(self, at: Point) -> Point:
        """A point in metres as one on the paper, whose y grows downwards."""
        return self.x + at[0] * self.scale, self.y - at[1] * self.scale


def svg(title: str, views: Sequence[DrawingView]) -> str:
    """The picture of `views`, one under the other."""
    reaches = [_reach(view) for view in views]
    scale = WIDTH / max(right - left for left, right, _, _ in reaches)
    above = MARGIN
    inner: list[str] = []
    for view, (left, _, low, high) in zip(views, reaches, strict=True):
        sheet = DrawingSheet(scale, MARGIN - left * scale, above + MARGIN + high * scale)
        inner += _view(view, sheet, above)
        above += (high - low) * scale + 2 * MARGIN
    name = words(MARGIN, MARGIN / 2, title, font_weight="bold")
    return document(
        WIDTH + 2 * MARGIN, above, [name, *inner], font_family="sans-serif", font_size=TEXT
    )


def _view(view: DrawingView, sheet: DrawingSheet, above: float) -> Iterator[str]:
    yield words(MARGIN, above + TEXT, view.title)
    for outline in view.outlines:
        yield _outline(outline, sheet)
    for number, dimension in enumerate(view.dimensions):
        yield from _dimension(dimension, sheet, number)


def _outline(outline: DrawingOutline, sheet: DrawingSheet) -> str:
    return mark(
        "polygon" if outline.closed else "polyline",
        mark("title", escape(outline.name)),
        data_part=outline.name,
        points=points(map(sheet.place, outline.points)),
        fill=FILLS[outline.colour] if outline.closed else "none",
        fill_opacity=0.8,
        stroke="#c03030" if outline.colour == "red" else "#222222",
    )


def _dimension(dimension: Dimension, sheet: DrawingSheet, number: int) -> Iterator[str]:
    (x1, y1), (x2, y2) = sheet.place(dimension.start), sheet.place(dimension.end)
    upright = abs(x2 - x1) < abs(y2 - y1)
    inside = dimension.start[0] == 0.0 and upright
    # Lengths at the edge are drawn outside of it, those of the axle where it is.
    if not inside and upright:
        x1 = x2 = x1 - 2 * TEXT
    elif not inside:
        y1 = y2 = y1 + 1.5 * TEXT
    yield mark("line", x1=x1, y1=y1, x2=x2, y2=y2, stroke="#666666", stroke_dasharray="4 3")
    if upright:
        x, y = x1 - TEXT / 3, (y1 + y2) / 2
        turn = f"rotate(-90 {x:.2f} {y:.2f})"
        yield words(x, y, dimension.label, text_anchor="middle", transform=turn)
    else:
        x, y = (x1 + x2) / 2, y1 + TEXT * 1.2
        yield words(x, y, dimension.label, text_anchor="middle")


def _reach(view: DrawingView) -> tuple[float, float, float, float]:
    """Leftmost, rightmost, lowest and highest of a view, m."""
    points = [point for outline in view.outlines for point in outline.points]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return min(xs), max(xs), min(ys), max(ys)
