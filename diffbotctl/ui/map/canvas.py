"""The map's canvas: layers of braille dots, walls in quarter blocks, marks on top; its camera.

Without UTF-8 each layer is drawn with a letter of its own. Positions are metres in odom. One
character is two dots wide and four high (braille), so that dots are square on most terminals.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum
from itertools import pairwise
from math import ceil, cos, pi, sin
from typing import NamedTuple

from diffbotctl.ui.plot.canvas import BRAILLE, Cell, CharacterCanvas

DOTS_ACROSS, DOTS_DOWN = BRAILLE.across, BRAILLE.down  # of one character
FIT_MARGIN_DOTS = 3  # kept free at each edge by `fit_camera`
VIEW_MIN_SPAN_M = 0.5  # `fit_camera` goes no closer
SCALE_MAX, SCALE_MIN = 400.0, 0.5  # dots a metre

Point = tuple[float, float]


class Camera(NamedTuple):
    """The middle of the window (x, y in m, odom) and its scale in dots a metre; x runs right."""

    x: float
    y: float
    scale: float

    def dot(self, point: Point, width: int, height: int) -> tuple[int, int]:
        """Column and row of a position's dot, in a window of `width` x `height` characters."""
        column = (point[0] - self.x) * self.scale + width * DOTS_ACROSS / 2
        row = height * DOTS_DOWN / 2 - (point[1] - self.y) * self.scale
        return round(column), round(row)

    def place(self, column: float, row: float, width: int, height: int) -> Point:
        """The position under the middle of the character at `column`, `row`."""
        right = (column + 0.5) * DOTS_ACROSS - width * DOTS_ACROSS / 2
        up = height * DOTS_DOWN / 2 - (row + 0.5) * DOTS_DOWN
        return self.x + right / self.scale, self.y + up / self.scale

    def zoomed(self, factor: float) -> Camera:
        """Closer by `factor`, within limits."""
        return self._replace(scale=min(max(self.scale * factor, SCALE_MIN), SCALE_MAX))

    def moved(self, columns: float, rows: float) -> Camera:
        """Moved to the right and down by so many characters."""
        return self._replace(
            x=self.x + columns * DOTS_ACROSS / self.scale, y=self.y - rows * DOTS_DOWN / self.scale
        )


def fit_camera(points: Iterable[Point], width: int, height: int) -> Camera:
    """A camera that has all of `points` in a window of `width` x `height` characters."""
    xs, ys = zip(*(list(points) or [(0.0, 0.0)]), strict=True)
    columns = max(width * DOTS_ACROSS - 2 * FIT_MARGIN_DOTS, 1)
    rows = max(height * DOTS_DOWN - 2 * FIT_MARGIN_DOTS, 1)
    scale = min(
        columns / max(max(xs) - min(xs), VIEW_MIN_SPAN_M),
        rows / max(max(ys) - min(ys), VIEW_MIN_SPAN_M),
    )
    middle = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    return Camera(*middle, min(max(scale, SCALE_MIN), SCALE_MAX))


QUARTERS = " ▘▝▀▖▌▞▛▗▚▐▜▄▙▟█"  # 1 upper left, 2 upper right, 4 lower left, 8 lower right
QUARTER_BITS = (0x03, 0x18, 0x44, 0xA0)  # the braille dots in each of these quarters
ARROWS, PLAIN_ARROWS = "→↗↑↖←↙↓↘", ">/^\\</v\\"  # x forward is drawn to the right, y left upwards
LINE_MAX_DOTS = 4000  # of one line; more than any window has
WIDE_LINE_MAX_DOTS = 40  # across
CIRCLE_CORNERS = 48


class MapLayer(IntEnum):
    """What a dot belongs to; in one character the highest layer is shown."""

    BEAM = 0
    TRAIL = 1
    PATH = 2
    UNCERTAINTY = 3
    SCAN = 4
    MAP = 5
    WALL = 6
    ROBOT = 7
    GOAL = 8


STYLES = (
    "yellow",
    "cyan",
    "magenta",
    "blue",
    "bright_red",
    "bright_blue",
    "white",
    "bold green",
    "bold magenta",
)
LETTERS = ":.,~x%#o+"


class MapCanvas(CharacterCanvas):
    """A window of `width` x `height` characters on the floor."""

    def __init__(
        self, camera: Camera, width: int, height: int, plain: bool = False, background: str = ""
    ) -> None:
        """`background`: colour of the floor, #rrggbb; empty: the terminal's."""
        super().__init__(width, height)
        self.camera, self.plain = camera, plain
        self.background = f" on {background}" if background else ""
        self.layers: dict[tuple[int, int], MapLayer] = {}

    def point(self, point: Point, layer: MapLayer) -> None:
        self.layer_dot(*self.camera.dot(point, self.width, self.height), layer)

    def line(
        self, start: Point, end: Point, layer: MapLayer, every: int = 1, colour: str | None = None
    ) -> None:
        """Set every `every`-th dot of a line; `colour` replaces the colour of the trail."""
        x0, y0 = self.camera.dot(start, self.width, self.height)
        x1, y1 = self.camera.dot(end, self.width, self.height)
        steps = max(abs(x1 - x0), abs(y1 - y0), 1)
        if steps > LINE_MAX_DOTS:
            return  # seen from so near that it is no line any more
        for i in range(0, steps + 1, every):
            self.layer_dot(x0 + (x1 - x0) * i // steps, y0 + (y1 - y0) * i // steps, layer, colour)

    def wide_line(
        self, start: Point, end: Point, layer: MapLayer, width: float, colour: str | None = None
    ) -> None:
        """A line of a width in m, of at least one dot."""
        dots = min(max(round(width * self.camera.scale), 1), WIDE_LINE_MAX_DOTS)
        is_flat = abs(end[0] - start[0]) >= abs(end[1] - start[1])
        for number in range(dots):
            aside = (number - (dots - 1) / 2) / self.camera.scale
            x, y = (0.0, aside) if is_flat else (aside, 0.0)
            self.line((start[0] + x, start[1] + y), (end[0] + x, end[1] + y), layer, colour=colour)

    def lines(self, corners: Sequence[Point], layer: MapLayer, every: int = 1) -> None:
        for start, end in pairwise(corners):
            self.line(start, end, layer, every)

    def circle(self, middle: Point, radius: float, layer: MapLayer) -> None:
        turns = [2 * pi * i / CIRCLE_CORNERS for i in range(CIRCLE_CORNERS + 1)]
        x, y = middle
        self.lines([(x + radius * cos(turn), y + radius * sin(turn)) for turn in turns], layer)

    def mark(self, point: Point, character: str, style: str) -> None:
        """Put a character at a position, over any dots."""
        x, y = self.camera.dot(point, self.width, self.height)
        self.put(x // DOTS_ACROSS, y // DOTS_DOWN, character, style + self.background)

    def arrow(self, point: Point, heading: float, style: str) -> None:
        """Put an arrow in the direction of `heading`."""
        arrows = PLAIN_ARROWS if self.plain else ARROWS
        self.mark(point, arrows[round(heading / (pi / 4)) % len(arrows)], style)

    def write(self, column: int, row: int, text: str, style: str = "dim") -> None:
        for at, character in enumerate(text, column):
            self.put(at, row, character, style + self.background)

    def layer_dot(self, x: int, y: int, layer: MapLayer, colour: str | None = None) -> None:
        """Set a dot of a layer, unless a higher one is shown there."""
        cell = (x // DOTS_ACROSS, y // DOTS_DOWN)
        self.dot(x, y, colour or self.styles.get(cell))
        if cell in self.dots and layer >= self.layers.get(cell, layer):
            self.layers[cell] = layer

    def cell(self, column: int, row: int) -> Cell:
        """The character at a place, in the style of its highest layer."""
        place = (column, row)
        if place in self.characters:
            return self.characters[place]
        bits = self.dots.get(place)
        if bits is None:
            return " ", self.background.strip() or None
        layer = self.layers[place]
        colour = self.styles[place] if layer is MapLayer.TRAIL else None
        style = (colour or STYLES[layer]) + self.background
        if self.plain:
            return LETTERS[layer], style
        if layer is MapLayer.WALL:
            quarters = (1 << i for i, quarter in enumerate(QUARTER_BITS) if bits & quarter)
            return QUARTERS[sum(quarters)], style
        return self.font.characters[bits], style


def scale_bar(camera: Camera, width: int, plain: bool = False) -> str:
    """A bar of a round length that fits into a third of the window, with that length."""
    limit = max(width / 3, 4) * DOTS_ACROSS / camera.scale
    lengths = (m * 10.0**e for e in range(-2, 4) for m in (1, 2, 5))
    length = max((length for length in lengths if length <= limit), default=0.01)
    columns = max(ceil(length * camera.scale / DOTS_ACROSS), 2)
    left, middle, right = "|-|" if plain else "├─┤"
    return f"{left}{middle * (columns - 2)}{right} {length:g} m"
