"""A picture of end errors as SVG text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

SIZE = 480  # pixels, each way
EDGE = 40  # pixels around the points
MM = 1000.0
COLOURS = ("#c0392b", "#2e7d32", "#1f4e9c", "#7b1fa2")
NICE = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)  # mm between two lines of the grid

Point = tuple[float, float]


def ends(title: str, points: Mapping[str, Sequence[Point]]) -> str:
    """Points (m) by their kind around the place where they should all lie, x right, y up."""
    everything = [abs(each) for many in points.values() for point in many for each in point]
    reach = max([*everything, 0.005]) * MM * 1.1  # half of the picture's width, in mm
    scale = (SIZE / 2 - EDGE) / reach
    step = next((nice for nice in NICE if reach / nice <= 5), NICE[-1])
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{SIZE}" height="{SIZE + EDGE}" '
        'font-family="sans-serif" font-size="12">',
        f'<rect width="{SIZE}" height="{SIZE + EDGE}" fill="white"/>',
        f'<text x="{EDGE}" y="20" font-size="14">{escape(title)}</text>',
        *_grid(step, reach, scale),
    ]
    for number, (kind, many) in enumerate(points.items()):
        colour = COLOURS[number % len(COLOURS)]
        parts += [_dot(_place(point, scale), colour) for point in many]
        y = SIZE + 8 + 14 * (number // 2)
        x = EDGE + (number % 2) * SIZE // 2
        parts.append(_dot((x, y - 4), colour))
        parts.append(f'<text x="{x + 10}" y="{y}">{escape(kind)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"


def _grid(step: int, reach: float, scale: float) -> list[str]:
    lines = []
    count = int(reach // step)
    for number in range(-count, count + 1):
        at = number * step / MM
        x, y = _place((at, at), scale)
        colour = "#888" if number == 0 else "#ddd"
        low, high = EDGE, SIZE - EDGE
        lines.append(f'<path d="M{x:.1f} {low}V{high}M{low} {y:.1f}H{high}" stroke="{colour}"/>')
        lines.append(
            f'<text x="{x:.1f}" y="{high + 14}" text-anchor="middle">{number * step}</text>'
        )
    lines.append(f'<text x="{SIZE - EDGE}" y="{SIZE - EDGE + 28}" text-anchor="end">mm</text>')
    return lines


def _place(point: Point, scale: float) -> Point:
    return SIZE / 2 + point[0] * MM * scale, SIZE / 2 - point[1] * MM * scale


def _dot(at: Point, colour: str) -> str:
    return f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="4" fill="{colour}"/>'
