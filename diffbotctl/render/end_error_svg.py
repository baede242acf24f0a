"""A picture of end errors as SVG text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from diffbotctl.render.svg import Point, document, mark, words

SIZE = 480  # pixels, each way
EDGE = 40  # pixels around the points
MM = 1000.0
COLOURS = ("#c0392b", "#2e7d32", "#1f4e9c", "#7b1fa2")
NICE = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)  # mm between two lines of the grid


def ends(title: str, points: Mapping[str, Sequence[Point]]) -> str:
    """Points (m) by their kind around the place where they should all lie, x right, y up."""
    everything = [abs(each) for many in points.values() for point in many for each in point]
    reach = max([*everything, 0.005]) * MM * 1.1  # half of the picture's width, in mm
    scale = (SIZE / 2 - EDGE) / reach
    step = next((nice for nice in NICE if reach / nice <= 5), NICE[-1])
    marks = [words(EDGE, 20, title, font_size=14), *_grid(step, reach, scale)]
    for number, (kind, many) in enumerate(points.items()):
        colour = COLOURS[number % len(COLOURS)]
        marks += [_dot(_place(point, scale), colour) for point in many]
        y = SIZE + 8 + 14 * (number // 2)
        x = EDGE + (number % 2) * SIZE // 2
        marks += [_dot((x, y - 4), colour), words(x + 10, y, kind)]
    return document(SIZE, SIZE + EDGE, marks, font_family="sans-serif", font_size=12)


def _grid(step: int, reach: float, scale: float) -> list[str]:
    marks = []
    count = int(reach // step)
    for number in range(-count, count + 1):
        at = number * step / MM
        x, y = _place((at, at), scale)
        colour = "#888" if number == 0 else "#ddd"
        low, high = EDGE, SIZE - EDGE
        route = f"M{x:.1f} {low}V{high}M{low} {y:.1f}H{high}"
        marks.append(mark("path", d=route, stroke=colour))
        marks.append(words(x, high + 14, str(number * step), text_anchor="middle"))
    return [*marks, words(SIZE - EDGE, SIZE - EDGE + 28, "mm", text_anchor="end")]


def _place(point: Point, scale: float) -> Point:
    return SIZE / 2 + point[0] * MM * scale, SIZE / 2 - point[1] * MM * scale


def _dot(at: Point, colour: str) -> str:
    return mark("circle", cx=at[0], cy=at[1], r=4, fill=colour)
