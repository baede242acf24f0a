"""Which part of the floor is looked at: from metres in odom to dots on a terminal and back.

One character is two dots wide and four high (braille), so that dots are square on most terminals.

A map of the floor in characters: layers of braille dots, walls in quarter blocks, marks on top.

Without UTF-8 each layer has a letter of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum
from itertools import pairwise
from math import ceil, cos, pi, sin
from typing import NamedTuple

from rich.text import Text

from diffbotctl.ui.plot.canvas import BRAILLE

ACROSS, DOWN = 2, 4  # dots a character
FIT_MARGIN_DOTS = 3  # dots kept free at each edge by `around`
VIEW_MIN_SPAN_M = 0.5  # m; nearer than that nothing is looked at by itself
SCALE_MAX, SCALE_MIN = 400.0, 0.5  # dots a metre

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
        return self._replace(scale=min(max(self.scale * factor, SCALE_MIN), SCALE_MAX))

    def moved(self, columns: float, rows: float) -> Camera:
        """Looking so many characters farther to the right and down."""
        return self._replace(
            x=self.x + columns * ACROSS / self.scale, y=self.y - rows * DOWN / self.scale
        )


def fit_camera(points: Iterable[Point], width: int, height: int) -> Camera:
    """A camera that has all of `points` in a window of `width` x `height` characters."""
    seen = list(points) or [(0.0, 0.0)]
    xs, ys = [p[0] for p in seen], [p[1] for p in seen]
    across = max(width * ACROSS - 2 * FIT_MARGIN_DOTS, 1) / max(max(xs) - min(xs), VIEW_MIN_SPAN_M)
    down = max(height * DOWN - 2 * FIT_MARGIN_DOTS, 1) / max(max(ys) - min(ys), VIEW_MIN_SPAN_M)
    scale = min(max(min(across, down), SCALE_MIN), SCALE_MAX)
    return Camera((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2, scale)


QUARTERS = " ▘▝▀▖▌▞▛▗▚▐▜▄▙▟█"  # 1 upper left, 2 upper right, 4 lower left, 8 lower right
ARROWS, PLAIN_ARROWS = "→↗↑↖←↙↓↘", ">/^\\</v\\"  # x forward is drawn to the right, y left upwards
LINE_MAX_DOTS = 4000  # of one line: more than any window has
CIRCLE_CORNERS = 48  # corners of a circle


class MapLayer(IntEnum):
    """What a dot belongs to; in one character the highest wins."""

    BEAM = 0
    TRAIL = 1
    WAY = 2
    DOUBT = 3
    SCAN = 4
    WALL = 5
    ROBOT = 6
    GOAL = 7


STYLES = ("yellow", "cyan", "magenta", "blue", "bright_red", "white", "bold green", "bold magenta")
LETTERS = ":.,~x#o+"


class MapCanvas:
    """A window of `width` x `height` characters on the floor. Positions are metres in odom."""

    def __init__(
        self, camera: Camera, width: int, height: int, plain: bool = False, ground: str = ""
    ) -> None:
        """`ground`: colour of the floor, #rrggbb; none: the terminal's."""
        self.camera, self.width, self.height, self.plain = camera, width, height, plain
        self.ground = f" on {ground}" if ground else ""
        self.ink = ""  # colour of the trail that is being drawn
        self.inks: dict[tuple[int, int], str] = {}
        self.dots: dict[tuple[int, int], int] = {}
        self.layers: dict[tuple[int, int], MapLayer] = {}
        self.marks: dict[tuple[int, int], tuple[str, str]] = {}

    def dot(self, at: Point, layer: MapLayer) -> None:
        """Set the dot at a position; outside the window nothing happens."""
        self._set(*self.camera.dot(at, self.width, self.height), layer)

    def line(self, start: Point, end: Point, layer: MapLayer, every: int = 1) -> None:
        """Set every `every`-th dot of a line."""
        c1, r1 = self.camera.dot(start, self.width, self.height)
        c2, r2 = self.camera.dot(end, self.width, self.height)
        steps = max(abs(c2 - c1), abs(r2 - r1), 1)
        if steps > LINE_MAX_DOTS:
            return  # seen from so near that it is no line any more
        for i in range(0, steps + 1, every):
            self._set(c1 + (c2 - c1) * i // steps, r1 + (r2 - r1) * i // steps, layer)

    def stroke(self, start: Point, end: Point, ink: str) -> None:
        """A line of the trail in a colour of its own; a character has that of its last one."""
        self.ink = ink
        self.line(start, end, MapLayer.TRAIL)
        self.ink = ""

    def lines(self, corners: Sequence[Point], layer: MapLayer, every: int = 1) -> None:
        """A line through all corners."""
        for start, end in pairwise(corners):
            self.line(start, end, layer, every)

    def round(self, at: Point, radius: float, layer: MapLayer) -> None:
        """A circle."""
        self.lines(
            [
                (at[0] + radius * cos(turn), at[1] + radius * sin(turn))
                for turn in (2 * pi * i / CIRCLE_CORNERS for i in range(CIRCLE_CORNERS + 1))
            ],
            layer,
        )

    def mark(self, at: Point, sign: str, style: str) -> None:
        """Put a character at a position, over any dots."""
        column, row = self.camera.dot(at, self.width, self.height)
        self.marks[(column // ACROSS, row // DOWN)] = (sign, style)

    def arrow(self, at: Point, heading: float, style: str) -> None:
        """Put an arrow that looks along `heading`."""
        arrows = PLAIN_ARROWS if self.plain else ARROWS
        self.mark(at, arrows[round(heading / (pi / 4)) % len(arrows)], style)

    def write(self, column: int, row: int, words: str, style: str = "dim") -> None:
        """Put words at a place of the window, in characters."""
        for i, sign in enumerate(words):
            self.marks[(column + i, row)] = (sign, style)

    def text(self) -> Text:
        """The window as lines of text."""
        out = Text(no_wrap=True, end="")
        for row in range(self.height):
            for words, style in _runs(self._cell(column, row) for column in range(self.width)):
                out.append(words, style)
            if row < self.height - 1:
                out.append("\n")
        return out

    def _set(self, column: int, row: int, layer: MapLayer) -> None:
        cell = (column // ACROSS, row // DOWN)
        if 0 <= cell[0] < self.width and 0 <= cell[1] < self.height:
            self.dots[cell] = self.dots.get(cell, 0) | BRAILLE.bits[column % ACROSS][row % DOWN]
            if layer >= self.layers.get(cell, layer):
                self.layers[cell] = layer
            if self.ink:
                self.inks[cell] = self.ink

    def _cell(self, column: int, row: int) -> tuple[str, str | None]:
        mark = self.marks.get((column, row))
        if mark is not None:
            return mark[0], mark[1] + self.ground
        bits = self.dots.get((column, row))
        if bits is None:
            return " ", self.ground.strip() or None
        layer = self.layers[column, row]
        style = STYLES[layer] + self.ground
        if layer is MapLayer.TRAIL and (column, row) in self.inks:
            style = self.inks[column, row] + self.ground
        if self.plain:
            return LETTERS[layer], style
        return _quarters(bits) if layer is MapLayer.WALL else BRAILLE.character(bits), style


def _quarters(bits: int) -> str:
    """The dots of one character in quarter blocks, which are seen better."""
    upper_left, upper_right = bits & 0x03, bits & 0x18
    lower_left, lower_right = bits & 0x44, bits & 0xA0
    parts = (upper_left, upper_right, lower_left, lower_right)
    return QUARTERS[sum(1 << i for i, part in enumerate(parts) if part)]


def _runs(cells: Iterable[tuple[str, str | None]]) -> Iterable[tuple[str, str | None]]:
    """Neighbours of one style joined."""
    words, style = "", None
    for sign, wanted in cells:
        if wanted != style and words:
            yield words, style
            words = ""
        style = wanted
        words += sign
    yield words, style


def scale_bar(camera: Camera, width: int, plain: bool = False) -> str:
    """A bar of a round length that fits into a third of the window, with that length."""
    longest = max(width / 3, 4) * ACROSS / camera.scale
    length = max(
        (m * 10.0**e for e in range(-2, 4) for m in (1, 2, 5) if m * 10.0**e <= longest),
        default=0.01,
    )
    columns = max(ceil(length * camera.scale / ACROSS), 2)
    left, middle, right = "|-|" if plain else "├─┤"
    return f"{left}{middle * (columns - 2)}{right} {length:g} m"
