"""A grid of dots drawn with characters: braille where the terminal has it, else plain ASCII."""

from __future__ import annotations

from typing import NamedTuple


class DotFont(NamedTuple):
    """How many dots a character cell has across and down, and the characters to write them."""

    across: int
    down: int
    first: int
    """Code point of the character without dots, when the others follow it in order of bits."""
    bits: tuple[tuple[int, ...], ...]
    """[column][row]: the bit of a dot in a cell"""
    characters: str = ""
    """Characters by bits, when they do not follow one another."""

    def character(self, bits: int) -> str:
        """The character for a cell with these dots."""
        return self.characters[bits] if self.characters else chr(self.first + bits)


# Unicode 15, block "Braille Patterns": dots 1 2 3 7 down the left, 4 5 6 8 down the right.
BRAILLE = DotFont(2, 4, 0x2800, ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80)))
ASCII = DotFont(1, 2, 0, ((1, 2),), " '.:")


class DotCanvas:
    """A canvas of `width` by `height` characters. Dots count from the upper left corner."""

    def __init__(self, width: int, height: int, font: DotFont) -> None:
        self.font = font
        self.width, self.height = width * font.across, height * font.down
        self.cells = [[0] * width for _ in range(height)]

    def set(self, x: int, y: int) -> None:
        """Set the dot in column `x` and row `y`; outside nothing happens."""
        if 0 <= x < self.width and 0 <= y < self.height:
            font = self.font
            bit = font.bits[x % font.across][y % font.down]
            self.cells[y // font.down][x // font.across] |= bit

    def line(self, x0: int, y0: int, x1: int, y1: int) -> None:
        """Set the dots from (x0, y0) to (x1, y1), as many as the longer way needs."""
        steps = max(abs(x1 - x0), abs(y1 - y0))
        for step in range(steps + 1):
            share = step / steps if steps else 0.0
            self.set(round(x0 + (x1 - x0) * share), round(y0 + (y1 - y0) * share))

    def rows(self) -> list[str]:
        """The canvas as lines of text."""
        blank, empty = self.font.character(0), " "
        return [
            "".join(self.font.character(bits) for bits in row).replace(blank, empty)
            for row in self.cells
        ]
