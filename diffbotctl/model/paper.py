"""Both views of a robot as one SVG picture, drawn to scale."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple
from xml.sax.saxutils import escape, quoteattr

from diffbotctl.model.drawing import Dimension, Outline, Point, View

WIDTH = 640.0  # px of the wider view; enough to read every length
MARGIN = 70.0  # px around a view, where its lengths are written
TEXT = 14.0  # px
FILLS = {"blue": "#cfe0f7", "black": "#9a9a9a", "grey": "#dddddd", "red": "#f4b6b6"}


class Sheet(NamedTuple):
    """Where a view lies on the paper: px a metre, and the paper's place of (0, 0)."""

    scale: float
    x: float
    y: float

    def place(self, at: Point) -> Point:
        """A point in metres as one on the paper, whose y grows downwards."""
        return self.x + at[0] * self.scale, self.y - at[1] * self.scale


def svg(title: str, views: Sequence[View]) -> str:
    """The picture of `views`, one under the other."""
    reaches = [_reach(view) for view in views]
    scale = WIDTH / max(right - left for left, right, _, _ in reaches)
    above = MARGIN
    inner: list[str] = []
    for view, (left, _, low, high) in zip(views, reaches, strict=True):
        sheet = Sheet(scale, MARGIN - left * scale, above + MARGIN + high * scale)
        inner += _view(view, sheet, above)
        above += (high - low) * scale + 2 * MARGIN
    width, height = WIDTH + 2 * MARGIN, above
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="sans-serif" font-size="{TEXT:g}">'
    )
    name = f'<text x="{MARGIN:g}" y="{MARGIN / 2:g}" font-weight="bold">{escape(title)}</text>'
    paper = '<rect width="100%" height="100%" fill="white"/>'
    return "\n".join([head, paper, name, *inner, "</svg>"]) + "\n"


def _view(view: View, sheet: Sheet, above: float) -> Iterator[str]:
    yield f'<text x="{MARGIN:g}" y="{above + TEXT:g}">{escape(view.title)}</text>'
    for outline in view.outlines:
        yield _outline(outline, sheet)
    for number, dimension in enumerate(view.dimensions):
        yield from _dimension(dimension, sheet, number)


def _outline(outline: Outline, sheet: Sheet) -> str:
    points = " ".join(f"{x:.2f},{y:.2f}" for x, y in map(sheet.place, outline.points))
    shape = "polygon" if outline.closed else "polyline"
    fill = FILLS[outline.colour] if outline.closed else "none"
    stroke = "#c03030" if outline.colour == "red" else "#222222"
    title = f"<title>{escape(outline.name)}</title>"
    name = quoteattr(outline.name)
    look = f'fill="{fill}" fill-opacity="0.8" stroke="{stroke}"'
    return f"<{shape} data-part={name} points={quoteattr(points)} {look}>{title}</{shape}>"


def _dimension(dimension: Dimension, sheet: Sheet, number: int) -> Iterator[str]:
    (x1, y1), (x2, y2) = sheet.place(dimension.start), sheet.place(dimension.end)
    upright = abs(x2 - x1) < abs(y2 - y1)
    inside = dimension.start[0] == 0.0 and upright
    # Lengths at the edge are drawn outside of it, those of the axle where it is.
    if not inside and upright:
        x1 = x2 = x1 - 2 * TEXT
    elif not inside:
        y1 = y2 = y1 + 1.5 * TEXT
    line = f'<line x1="{x1:.2f}" y1="{y1:.2f}" x2="{x2:.2f}" y2="{y2:.2f}"'
    yield f'{line} stroke="#666666" stroke-dasharray="4 3"/>'
    label = escape(dimension.label)
    if upright:
        x, y = x1 - TEXT / 3, (y1 + y2) / 2
        turn = f'transform="rotate(-90 {x:.2f} {y:.2f})"'
        yield f'<text x="{x:.2f}" y="{y:.2f}" text-anchor="middle" {turn}>{label}</text>'
    else:
        y = y1 + TEXT * 1.2
        yield f'<text x="{(x1 + x2) / 2:.2f}" y="{y:.2f}" text-anchor="middle">{label}</text>'


def _reach(view: View) -> tuple[float, float, float, float]:
    """Leftmost, rightmost, lowest and highest of a view, m."""
    points = [point for outline in view.outlines for point in outline.points]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return min(xs), max(xs), min(ys), max(ys)
