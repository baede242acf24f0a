"""Text for terminals: bars, aligned columns, folded sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from diffbotctl.errors import WIDTH
from diffbotctl.printable import fold_words, printable

EIGHTHS = " ▏▎▍▌▋▊▉█"


def render_bar(share: float, width: int, plain: bool = False) -> str:
    """A bar over `share` (0 to 1) of `width` characters."""
    share = min(max(share, 0.0), 1.0)
    if plain:
        return ("#" * round(share * width)).ljust(width, "-")
    whole, part = divmod(round(share * width * 8), 8)
    return (EIGHTHS[8] * whole + (EIGHTHS[part] if part else "")).ljust(width)


def render_signed_bar(share: float, width: int, plain: bool = False) -> str:
    """A bar from the middle of `width` characters, `share` (-1 to 1) of it to the right."""
    half = width // 2
    full, empty = ("#", "-") if plain else ("█", "─")
    length = min(round(abs(share) * half), half)
    filled = full * length + empty * (half - length)
    left, right = (filled[::-1], empty * half) if share < 0 else (empty * half, filled)
    return f"{left}{'|' if plain else '┼'}{right}"


def render_columns(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lines in which each column is as wide as its widest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True))
        yield "  ".join(cells).rstrip()


def fold_text(text: str, hang: int = 0, width: int = WIDTH) -> str:
    """Each line of `text` folded at `width` columns; continued lines keep the indentation.

    `hang`: columns by which continued lines are indented further.
    """
    lines = printable(text).split("\n")
    return "\n".join(part for line in lines for part in _parts(line, hang, width))


def shorten_text(text: str, width: int) -> str:
    """`text` in at most `width` columns: it ends between words, with an ellipsis."""
    if len(text) <= width:
        return text
    return f"{text[: max(width, 0)].rpartition(' ')[0].rstrip()}…" if width > 1 else ""


def _parts(line: str, hang: int, width: int) -> list[str]:
    if len(line) <= width:
        return [line]
    indent = " " * (len(line) - len(line.lstrip(" ")))
    return fold_words(line.strip(" "), width, indent, indent + " " * hang)
