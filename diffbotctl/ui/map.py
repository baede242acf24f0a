"""A map of the floor in characters: trail in braille dots, robot, goal and walls on top."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi

from rich.text import Text

DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # braille: 4 rows of 2 dots
ARROWS = "→↗↑↖←↙↓↘"  # x forward is drawn to the right, y left upwards

Point = tuple[float, float]
LEAST = 0.5  # m; a robot that has not moved yet is not drawn through a magnifying glass


class Map:
    """A window on the floor: `width` x `height` characters around what must be seen.

    Positions are metres in odom; one character is two dots wide and four high, so dots are square.
    """

    def __init__(
        self, width: int, height: int, seen: Iterable[Point], least: float = LEAST
    ) -> None:
        self.width, self.height = width, height
        points = list(seen) or [(0.0, 0.0)]
        xs, ys = [p[0] for p in points], [p[1] for p in points]
        span = max(max(xs) - min(xs), (max(ys) - min(ys)) * width * 2 / (height * 4), least)
        self.scale = (width * 2 - 6) / span  # dots a metre
        self.middle = ((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2)
        self.dots: dict[tuple[int, int], int] = {}
        self.marks: dict[tuple[int, int], tuple[str, str]] = {}

    def dot(self, at: Point) -> None:
        """Set the dot at a position; outside the window nothing happens."""
        column, row = self._dot(at)
        cell = (column // 2, row // 4)
        if 0 <= cell[0] < self.width and 0 <= cell[1] < self.height:
            self.dots[cell] = self.dots.get(cell, 0) | DOTS[row % 4][column % 2]

    def line(self, start: Point, end: Point) -> None:
        """Set the dots of a line, as of a wall."""
        length = max(abs(end[0] - start[0]), abs(end[1] - start[1])) * self.scale
        steps = max(1, min(int(length), 4 * (self.width + self.height)))
        for i in range(steps + 1):
            part = i / steps
            self.dot((start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])))

    def mark(self, at: Point, sign: str, style: str) -> None:
        """Put a character at a position, over any dots."""
        column, row = self._dot(at)
        self.marks[(column // 2, row // 4)] = (sign, style)

    def robot(self, at: Point, heading: float) -> None:
        """Put an arrow that shows where the robot looks."""
        self.mark(at, ARROWS[round(heading / (pi / 4)) % 8], "bold green")

    def text(self) -> Text:
        """The window as lines of text."""
        out = Text(no_wrap=True)
        for row in range(self.height):
            for column in range(self.width):
                mark = self.marks.get((column, row))
                if mark is not None:
                    out.append(mark[0], mark[1])
                else:
                    bits = self.dots.get((column, row))
                    out.append(chr(0x2800 + bits) if bits else " ", "cyan" if bits else None)
            if row < self.height - 1:
                out.append("\n")
        return out

    def _dot(self, at: Point) -> tuple[int, int]:
        column = (at[0] - self.middle[0]) * self.scale + self.width
        row = self.height * 2 - (at[1] - self.middle[1]) * self.scale
        return round(column), round(row)
