"""Colour sensor: what a turtle sees below it, as turtlesim's `color_sensor`."""

from __future__ import annotations

from math import ceil, floor, hypot, sqrt

from diffbotctl.block import Block, In, Out
from diffbotctl.geometry.trail import JUMP_MIN_M
from diffbotctl.messages import Canvas, Color, Odometry
from diffbotctl.params import Param

CELL_M = 0.05  # smaller than the width of the pen
BACKGROUND = 0  # in a cell without a line
PENS_MAX = 256


class ColorSensor(Block):
    """Publish the colour of the canvas below turtle 1: its background, or a line.

    The line that turtle 1 draws is seen too: what lies below it shows with the pen up. The lines of
    other turtles are not.

    blocks:
      color: {block: color_sensor, in: {canvas: canvas.canvas, odometry: robot.pose}}
    """

    width = Param(float, unit="m", default=11.09, above=0.0, help="Width of the canvas, along x.")
    height = Param(float, unit="m", default=11.09, above=0.0, help="Height of the canvas, along y.")

    canvas = In(Canvas, trigger=False, help="Colours, width and state of the pen.")
    odometry = In(Odometry, help="Pose of the turtle, in the frame of the canvas.")
    color = Out(Color, help="The colour, at each pose; none after turtle 1 was killed.")

    def reset(self) -> None:
        self.columns, self.rows = ceil(self.width / CELL_M), ceil(self.height / CELL_M)
        self.sheet = 0
        self.pens: list[str] = [""]  # by what a cell holds; the first one is the background
        self._clear()
        self.last: tuple[float, float] | None = None

    def react(self, now: int, canvas: Canvas | None, odometry: Odometry | None) -> Color | None:
        if canvas is None or odometry is None or not canvas.has_first:
            self.last = None
            return None
        if canvas.sheet != self.sheet:
            self.sheet = canvas.sheet
            self._clear()
        place = (odometry.x, odometry.y)
        seen = self.pens[self.cells[self._cell(*place)]] or canvas.background
        if self.last is not None and canvas.is_down and place != self.last:
            self._draw(self.last, place, canvas)
        self.last = place
        return Color(now, *(int(seen[i : i + 2], 16) for i in (1, 3, 5)))

    def _clear(self) -> None:
        self.cells = bytearray(self.columns * self.rows)

    def _cell(self, x: float, y: float) -> int:
        column = min(max(floor(x / CELL_M), 0), self.columns - 1)
        row = min(max(floor(y / CELL_M), 0), self.rows - 1)
        return row * self.columns + column

    def _draw(self, start: tuple[float, float], end: tuple[float, float], canvas: Canvas) -> None:
        """Colour the cells of a line, unless the turtle was put elsewhere."""
        length = hypot(end[0] - start[0], end[1] - start[1])
        if length >= JUMP_MIN_M:
            return
        pen = self._pen(canvas.pen)
        steps = ceil(length / CELL_M)
        for step in range(steps + 1):
            share = step / steps
            x = start[0] + share * (end[0] - start[0])
            y = start[1] + share * (end[1] - start[1])
            self._dot(x, y, canvas.pen_width / 2, pen)

    def _dot(self, x: float, y: float, radius: float, pen: int) -> None:
        """Colour the cell at a place, and those whose middle is within the radius."""
        self.cells[self._cell(x, y)] = pen
        first_row, last_row = floor((y - radius) / CELL_M), floor((y + radius) / CELL_M)
        for row in range(max(first_row, 0), min(last_row + 1, self.rows)):
            beside = radius * radius - ((row + 0.5) * CELL_M - y) ** 2
            if beside < 0.0:
                continue
            half_width = sqrt(beside)
            first = max(ceil((x - half_width) / CELL_M - 0.5), 0)
            last = min(floor((x + half_width) / CELL_M - 0.5), self.columns - 1)
            if first <= last:
                begin = row * self.columns
                self.cells[begin + first : begin + last + 1] = bytes((pen,)) * (last - first + 1)

    def _pen(self, colour: str) -> int:
        """What a cell of this colour holds. With more colours than fit, the newest replaces one."""
        if colour in self.pens:
            return self.pens.index(colour)
        if len(self.pens) < PENS_MAX:
            self.pens.append(colour)
            return len(self.pens) - 1
        unused = (pen for pen in range(1, PENS_MAX) if pen not in self.cells)
        pen = next(unused, PENS_MAX - 1)
        self.pens[pen] = colour
        return pen
