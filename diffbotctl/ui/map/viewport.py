"""Which part of the floor is looked at: from metres in odom to dots on a terminal and back.

One character is two dots wide and four high (braille), so that dots are square on most terminals.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

ACROSS, DOWN = 2, 4  # dots a character
MARGIN = 3  # dots kept free at each edge by `around`
LEAST_SPAN = 0.5  # m; nearer than that nothing is looked at by itself
CLOSEST, FARTHEST = 400.0, 0.5  # dots a metre

Point = tuple[float, float]


class Camera(NamedTuple):
    """The middle of the window (x, y in m, odom) and its scale in dots a metre; x runs right."""

    x: float
    y: float
    scale: float

    def dot(self, at: Point, width: int, height: int) -> tuple[int, int]:
        """Column and row of a position's dot, in a window of `width` x `height` characters."""
        column = (at[0] - self.x) * self.scale + width * ACROSS / 2
        row = height * DOWN / 2 - (at[1] - self.y) * self.scale
        return round(column), round(row)

    def place(self, column: float, row: float, width: int, height: int) -> Point:
        """The position under the middle of the character at `column`, `row`."""
        across = (column + 0.5) * ACROSS - width * ACROSS / 2
        up = height * DOWN / 2 - (row + 0.5) * DOWN
        return self.x + across / self.scale, self.y + up / self.scale

    def zoomed(self, factor: float) -> Camera:
        """Closer by `factor`, within limits."""
        return self._replace(scale=min(max(self.scale * factor, FARTHEST), CLOSEST))

    def moved(self, columns: float, rows: float) -> Camera:
        """Looking so many characters farther to the right and down."""
        return self._replace(
            x=self.x + columns * ACROSS / self.scale, y=self.y - rows * DOWN / self.scale
        )


def around(points: Iterable[Point], width: int, height: int) -> Camera:
    """A camera that has all of `points` in a window of `width` x `height` characters."""
    seen = list(points) or [(0.0, 0.0)]
    xs, ys = [p[0] for p in seen], [p[1] for p in seen]
    across = max(width * ACROSS - 2 * MARGIN, 1) / max(max(xs) - min(xs), LEAST_SPAN)
    down = max(height * DOWN - 2 * MARGIN, 1) / max(max(ys) - min(ys), LEAST_SPAN)
    scale = min(max(min(across, down), FARTHEST), CLOSEST)
    return Camera((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2, scale)
