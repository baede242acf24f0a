"""Points of a curve, in characters, with both axes' numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.text import Text

WIDTH, HEIGHT = 60, 16  # characters
LABEL = 7  # characters for the numbers on the left
SIGNS = ".ox+"
STYLES = ("dim", "bold blue", "red", "green")

Point = tuple[float, float]


def curve(points: Mapping[str, Sequence[Point]], across: str, upwards: str) -> Text:
    """Points by their kind, later kinds over earlier ones; axes from the least to the most."""
    every = [point for many in points.values() for point in many]
    left, right = _span([x for x, _ in every])
    low, high = _span([y for _, y in every])
    cells: dict[tuple[int, int], int] = {}
    for kind, many in enumerate(points.values()):
        for x, y in many:
            column = round((x - left) / (right - left) * (WIDTH - 1))
            row = round((high - y) / (high - low) * (HEIGHT - 1))
            cells[(column, row)] = kind
    out = Text(no_wrap=True)
    for row in range(HEIGHT):
        label = {0: f"{high:.3g}", HEIGHT - 1: f"{low:.3g}"}.get(row, "")
        out.append(f"{label:>{LABEL}} |")
        for column in range(WIDTH):
            kind_here = cells.get((column, row))
            if kind_here is None:
                out.append(" ")
            else:
                out.append(SIGNS[kind_here % len(SIGNS)], STYLES[kind_here % len(STYLES)])
        out.append("\n")
    out.append(f"{'':>{LABEL}} +{'-' * WIDTH}\n")
    far = f"{right:.3g}"
    out.append(f"{'':>{LABEL}}  {f'{left:.3g}':<{WIDTH - len(far)}}{far}\n")
    legend = ", ".join(f"{SIGNS[n % len(SIGNS)]} {kind}" for n, kind in enumerate(points))
    out.append(f"{legend}; across {across}, upwards {upwards}")
    return out


def _span(values: Sequence[float]) -> Point:
    """The least and the most, apart."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    return (low, high) if high > low else (low, low + 1.0)
