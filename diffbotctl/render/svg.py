"""SVG elements and documents as text, and the plot of end errors of a calibration."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from xml.sax.saxutils import escape, quoteattr

Point = tuple[float, float]
PLOT_SIZE = 480  # pixels, width and height
PLOT_MARGIN = 40  # pixels around the points
MM = 1000.0  # a metre
PLOT_COLOURS = ("#c0392b", "#2e7d32", "#1f4e9c", "#7b1fa2")
GRID_STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)  # mm between grid lines


def element(kind: str, *inside: str, **attributes: object) -> str:
    """One element, such as `line` or `circle`, with the elements `inside` it.

    In the names of attributes `_` stands for `-`; a Python keyword gets a `_` at the end
    (`class_`). An attribute that is None is omitted. Numbers are in pixels, with two decimals.
    """
    text = "".join(
        f" {name.rstrip('_').replace('_', '-')}={quoteattr(format_number(value))}"
        for name, value in attributes.items()
        if value is not None
    )
    return f"<{kind}{text}>{''.join(inside)}</{kind}>" if inside else f"<{kind}{text}/>"


def text_element(x: float, y: float, text: str, **attributes: object) -> str:
    return element("text", escape(text), x=x, y=y, **attributes)


def points_attribute(corners: Iterable[Point]) -> str:
    """The attribute `points` of a polyline or polygon."""
    return " ".join(f"{format_number(x)},{format_number(y)}" for x, y in corners)


def svg_document(
    width: float,
    height: float,
    marks: Iterable[str],
    background: str = "white",
    **attributes: object,
) -> str:
    """A document with a background colour; later elements cover earlier ones."""
    width, height = round(width), round(height)
    backdrop = element("rect", width="100%", height="100%", fill=background)
    inside = "\n".join(["", "<!-- diffbotctl -->", backdrop, *marks, ""])
    box = f"0 0 {width} {height}"
    return (
        element(
            "svg",
            inside,
            xmlns="http://www.w3.org/2000/svg",
            width=width,
            height=height,
            viewBox=box,
            **attributes,
        )
        + "\n"
    )


def format_number(value: object) -> str:
    """A float as short text with at most two decimals; other values as their text."""
    if not isinstance(value, float):
        return str(value)
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def end_error_svg(title: str, points: Mapping[str, Sequence[Point]]) -> str:
    """Plot of points (m) by kind around the origin, where all should lie; x right, y up."""
    values = [abs(value) for group in points.values() for point in group for value in point]
    reach = max([*values, 0.005]) * MM * 1.1  # half of the width, mm
    scale = (PLOT_SIZE / 2 - PLOT_MARGIN) / reach
    step = next((nice for nice in GRID_STEPS if reach / nice <= 5), GRID_STEPS[-1])
    marks = [text_element(PLOT_MARGIN, 20, title, font_size=14), *_grid_lines(step, reach, scale)]
    for number, (kind, group) in enumerate(points.items()):
        colour = PLOT_COLOURS[number % len(PLOT_COLOURS)]
        marks += [_dot(_plot_point(point, scale), colour) for point in group]
        y = PLOT_SIZE + 8 + 14 * (number // 2)
        x = PLOT_MARGIN + (number % 2) * PLOT_SIZE // 2
        marks += [_dot((x, y - 4), colour), text_element(x + 10, y, kind)]
    return svg_document(
        PLOT_SIZE, PLOT_SIZE + PLOT_MARGIN, marks, font_family="sans-serif", font_size=12
    )


def _grid_lines(step: int, reach: float, scale: float) -> list[str]:
    marks = []
    count = int(reach // step)
    for number in range(-count, count + 1):
        at = number * step / MM
        x, y = _plot_point((at, at), scale)
        colour = "#888" if number == 0 else "#ddd"
        low, high = PLOT_MARGIN, PLOT_SIZE - PLOT_MARGIN
        route = f"M{x:.1f} {low}V{high}M{low} {y:.1f}H{high}"
        marks.append(element("path", d=route, stroke=colour))
        marks.append(text_element(x, high + 14, str(number * step), text_anchor="middle"))
    return [
        *marks,
        text_element(
            PLOT_SIZE - PLOT_MARGIN, PLOT_SIZE - PLOT_MARGIN + 28, "mm", text_anchor="end"
        ),
    ]


def _plot_point(point: Point, scale: float) -> Point:
    return PLOT_SIZE / 2 + point[0] * MM * scale, PLOT_SIZE / 2 - point[1] * MM * scale


def _dot(at: Point, colour: str) -> str:
    return element("circle", cx=at[0], cy=at[1], r=4, fill=colour)
