"""Bars of characters for a value among its limits.

Rows of text under one another.

Sentences that fit the narrowest terminal in common use, folded between words.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from diffbotctl.errors import WIDTH

EIGHTHS = " ▏▎▍▌▋▊▉█"


def render_bar(share: float, width: int, plain: bool = False) -> str:
    """`share` (0 to 1) of `width` characters."""
    share = min(max(share, 0.0), 1.0)
    if plain:
        return ("#" * round(share * width)).ljust(width, "-")
    whole, part = divmod(round(share * width * 8), 8)
    return (EIGHTHS[8] * whole + (EIGHTHS[part] if part else "")).ljust(width)


def render_signed_bar(share: float, width: int, plain: bool = False) -> str:
    """`share` (-1 to 1) from the middle of `width` characters to either side."""
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
    """Each line of `text` within `width` columns; what is folded keeps its line's indentation.

    `hang`: columns by which continued lines stand further in. A word that is longer than a line,
    such as a path, stays whole, so that it can be copied.
    """
    return "\n".join(part for line in text.split("\n") for part in _parts(line, hang, width))


def _parts(line: str, hang: int, width: int) -> list[str]:
    from textwrap import wrap

    if len(line) <= width:
        return [line]
    indent = " " * (len(line) - len(line.lstrip(" ")))
    return wrap(
        line.strip(" "),
        width,
        initial_indent=indent,
        subsequent_indent=indent + " " * hang,
        break_long_words=False,
        break_on_hyphens=False,
    )
