"""Points around an origin, in characters, with a scale in mm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.text import Text

WIDTH, HEIGHT = 61, 21  # characters, odd so that the origin has one of its own
ASPECT = 2.0  # a character is about twice as high as it is wide
FINEST = 0.005  # m from the middle to the edge at least
SIGNS = "ox+*"
STYLES = ("red", "green", "bold blue", "magenta")
MM = 1000.0

Point = tuple[float, float]


def scatter(points: Mapping[str, Sequence[Point]]) -> Text:
    """Points (m) by their kind; x to the right, y upwards, the origin in the middle."""
    reach = max([FINEST, *(_reach(point) for many in points.values() for point in many)])
    cells = _axes()
    for number, many in enumerate(points.values()):
        mark = (SIGNS[number % len(SIGNS)], STYLES[number % len(STYLES)])
        for point in many:
            cells[_cell(point, reach)] = mark
    out = Text(no_wrap=True)
    for row in range(HEIGHT):
        for column in range(WIDTH):
            sign, style = cells.get((column, row), (" ", ""))
            out.append(sign, style or None)
        out.append("\n")
    legend = ", ".join(f"{SIGNS[n % len(SIGNS)]} {kind}" for n, kind in enumerate(points))
    out.append(f"{legend}; from the middle to the upper edge {reach * MM:.0f} mm")
    return out


def _reach(point: Point) -> float:
    """How far the picture must reach upwards for `point` to be in it."""
    return max(abs(point[0]) * HEIGHT * ASPECT / WIDTH, abs(point[1]))


def _cell(point: Point, reach: float) -> tuple[int, int]:
    scale = (HEIGHT // 2) / reach  # rows a metre
    return WIDTH // 2 + round(point[0] * scale * ASPECT), HEIGHT // 2 - round(point[1] * scale)


def _axes() -> dict[tuple[int, int], tuple[str, str]]:
    middle = (WIDTH // 2, HEIGHT // 2)
    cells = {(column, middle[1]): ("-", "dim") for column in range(WIDTH)}
    cells.update({(middle[0], row): ("|", "dim") for row in range(HEIGHT)})
    cells[middle] = ("+", "dim")
    return cells
