"""The canvas of all terminal pictures: a grid of characters, drawn by dots or by whole characters.

Dots are braille where the terminal has it, else plain ASCII. Positions count from the upper left
corner: `x`, `y` of dots, `column`, `row` of characters. What lies outside is not drawn.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

from rich.text import Text

Cell = tuple[str, str | None]  # a character and its rich style


class DotFont(NamedTuple):
    """How many dots a character has across and down, and the characters that show them."""

    across: int
    down: int
    characters: str  # indexed by the bits of the dots that are set
    bits: tuple[tuple[int, ...], ...]  # [column][row]: the bit of a dot


# Unicode 15, block "Braille Patterns": dots 1 2 3 7 down the left, 4 5 6 8 down the right.
BRAILLE = DotFont(
    2,
    4,
    " " + "".join(map(chr, range(0x2801, 0x2900))),
    ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80)),
)
ASCII = DotFont(1, 2, " '.:", ((1, 2),))


class CharacterCanvas:
    """A canvas of `width` by `height` characters."""

    def __init__(self, width: int, height: int, font: DotFont = BRAILLE) -> None:
        self.width, self.height, self.font = width, height, font
        self.dot_width, self.dot_height = width * font.across, height * font.down
        self.dots: dict[tuple[int, int], int] = {}  # bits of each character's dots
        self.styles: dict[tuple[int, int], str | None] = {}  # of the dots
        self.characters: dict[tuple[int, int], Cell] = {}  # drawn over the dots

    def dot(self, x: int, y: int, style: str | None = None) -> None:
        """Set a dot; all dots of a character have the style that was set last."""
        if 0 <= x < self.dot_width and 0 <= y < self.dot_height:
            font = self.font
            cell = (x // font.across, y // font.down)
            bit = font.bits[x % font.across][y % font.down]
            self.dots[cell] = self.dots.get(cell, 0) | bit
            self.styles[cell] = style

    def polyline(self, points: Iterable[tuple[int, int] | None], style: str | None = None) -> None:
        """Set the dots from each point to the next; None is a gap."""
        last = None
        for point in points:
            if point is not None:
                self._line(last or point, point, style)
            last = point

    def put(self, column: int, row: int, character: str, style: str | None = None) -> None:
        """Put a character over the dots of its place."""
        self.characters[column, row] = (character, style)

    def cell(self, column: int, row: int) -> Cell:
        place = (column, row)
        if place in self.characters:
            return self.characters[place]
        return self.font.characters[self.dots.get(place, 0)], self.styles.get(place)

    def runs(self, row: int) -> Iterator[tuple[str, str]]:
        """One row: characters of one style, and this style; empty for none."""
        cells = (self.cell(column, row) for column in range(self.width))
        for style, run in groupby(cells, key=itemgetter(1)):
            yield "".join(character for character, _ in run), style or ""

    def row(self, row: int) -> Text:
        return Text.assemble(*self.runs(row))

    def text(self) -> Text:
        """All rows, without a line break after the last."""
        rows = (self.row(row) for row in range(self.height))
        return Text("\n", no_wrap=True, end="").join(rows)

    def _line(self, start: tuple[int, int], end: tuple[int, int], style: str | None) -> None:
        (x0, y0), (x1, y1) = start, end
        steps = max(abs(x1 - x0), abs(y1 - y0))
        for step in range(steps + 1):
            share = step / steps if steps else 0.0
            self.dot(round(x0 + (x1 - x0) * share), round(y0 + (y1 - y0) * share), style)
