"""Bars of characters for a value among its limits."""

from __future__ import annotations

EIGHTHS = " ▏▎▍▌▋▊▉█"


def bar(share: float, width: int, plain: bool = False) -> str:
    """`share` (0 to 1) of `width` characters."""
    share = min(max(share, 0.0), 1.0)
    if plain:
        return ("#" * round(share * width)).ljust(width, "-")
    whole, part = divmod(round(share * width * 8), 8)
    return (EIGHTHS[8] * whole + (EIGHTHS[part] if part else "")).ljust(width)


def swing(share: float, width: int, plain: bool = False) -> str:
    """`share` (-1 to 1) from the middle of `width` characters to either side."""
    half = width // 2
    full, empty = ("#", "-") if plain else ("█", "─")
    length = min(round(abs(share) * half), half)
    filled = full * length + empty * (half - length)
    left, right = (filled[::-1], empty * half) if share < 0 else (empty * half, filled)
    return f"{left}{'|' if plain else '┼'}{right}"
