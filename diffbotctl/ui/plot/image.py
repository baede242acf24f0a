"""Plots as image files: fields of one unit share a panel, all panels share the time axis.

A figure is a list of lines and texts in pixels, written as SVG, or as PNG with Pillow.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import BytesIO
from itertools import groupby
from math import isnan
from typing import Literal, NamedTuple

from diffbotctl.errors import Problem, UsageError
from diffbotctl.recording.fields import Series
from diffbotctl.render.svg import element, points_attribute, svg_document, text_element
from diffbotctl.ui.plot.axes import Axis, make_axis

FIGURE_WIDTH, PANEL_HEIGHT = 900, 240  # pixels
LEFT, RIGHT, TOP, BOTTOM, GAP = 70, 20, 40, 40, 30  # pixels around the panels and between them
TIME_TICKS, VALUE_TICKS = 9, 5
VALUE_MARGIN = 0.04  # of the span of the values, so that the frame hides no curve
FONT_SIZE = 12  # pixels
LETTER_WIDTH = 7.4  # pixels of a letter of that size in the widest of common fonts
# The colours of Okabe and Ito, distinct with colour vision deficiency too.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000")
GRID_COLOUR, INK_COLOUR = "#dddddd", "#333333"

Point = tuple[float, float]
Anchor = Literal["start", "middle", "end"]


class FigureLine(NamedTuple):
    """A line through points (x, y) in pixels from the upper left corner."""

    points: tuple[Point, ...]
    colour: str
    width: float


class FigureText(NamedTuple):
    """A text whose `anchor` is at x and whose base line is at y."""

    x: float
    y: float
    text: str
    anchor: Anchor = "start"
    colour: str = INK_COLOUR


class Figure(NamedTuple):
    """A picture of lines and texts, in pixels; later shapes lie on top."""

    width: int
    height: int
    shapes: tuple[FigureLine | FigureText, ...]


def make_figure(plotted: Sequence[Series], title: str) -> Figure:
    panels: dict[str, list[Series]] = {}
    for series in plotted:
        panels.setdefault(series.unit, []).append(series)
    begin = min(series.times[0] for series in plotted)
    end = max(series.times[-1] for series in plotted)
    time = make_axis(begin, end, TIME_TICKS)
    shapes: list[FigureLine | FigureText] = [FigureText(LEFT, TOP - 22, title)]
    top = TOP
    for unit, curves in panels.items():
        shapes += _panel(unit, curves, time, top)
        top += PANEL_HEIGHT + GAP
    bottom = top - GAP
    for tick in time.ticks:
        shapes.append(
            FigureText(_x(time, tick), bottom + FONT_SIZE + 6, time.label(tick), "middle")
        )
    unit_y = bottom + 2 * FONT_SIZE + 10
    shapes.append(FigureText(FIGURE_WIDTH - RIGHT, unit_y, "s since the start", "end"))
    return Figure(FIGURE_WIDTH, bottom + BOTTOM, tuple(shapes))


def encode_svg(figure: Figure) -> bytes:
    return svg_document(
        figure.width,
        figure.height,
        map(_svg_mark, figure.shapes),
        font_family="system-ui, sans-serif",
        font_size=FONT_SIZE,
    ).encode()


def _svg_mark(shape: FigureLine | FigureText) -> str:
    if isinstance(shape, FigureText):
        return text_element(
            shape.x, shape.y, shape.text, text_anchor=shape.anchor, fill=shape.colour
        )
    return element(
        "polyline",
        points=points_attribute(shape.points),
        fill="none",
        stroke=shape.colour,
        stroke_width=shape.width,
        stroke_linejoin="round",
    )


def _panel(
    unit: str, curves: list[Series], time: Axis, top: float
) -> Iterator[FigureLine | FigureText]:
    bounds = [series.bounds() for series in curves]
    minimum, maximum = min(low for low, _ in bounds), max(high for _, high in bounds)
    margin = VALUE_MARGIN * (maximum - minimum)
    values = make_axis(minimum - margin, maximum + margin, VALUE_TICKS)
    right, bottom = FIGURE_WIDTH - RIGHT, top + PANEL_HEIGHT
    for tick in values.ticks:
        y = _y(values, tick, top)
        yield FigureLine(((LEFT, y), (right, y)), GRID_COLOUR, 1)
        yield FigureText(LEFT - 6, y + FONT_SIZE / 3, values.label(tick), "end")
    for tick in time.ticks:
        x = _x(time, tick)
        yield FigureLine(((x, top), (x, bottom)), GRID_COLOUR, 1)
    if unit:
        yield FigureText(LEFT - 6, top - 6, unit, "end")
    name_x = float(LEFT)
    for number, series in enumerate(curves):
        colour = COLOURS[number % len(COLOURS)]
        yield FigureText(name_x, top - 6, series.name, "start", colour)
        name_x += len(series.name) * LETTER_WIDTH + FONT_SIZE
        samples = zip(series.times, series.values, strict=True)
        for is_gap, part in groupby(samples, key=lambda sample: isnan(sample[1])):
            if not is_gap:
                line = tuple((_x(time, at), _y(values, value, top)) for at, value in part)
                yield FigureLine(line, colour, 1.5)
    frame = ((LEFT, top), (right, top), (right, bottom), (LEFT, bottom), (LEFT, top))
    yield FigureLine(frame, INK_COLOUR, 1)


def _x(time: Axis, value: float) -> float:
    return LEFT + time.share(value) * (FIGURE_WIDTH - LEFT - RIGHT)


def _y(values: Axis, value: float, top: float) -> float:
    return top + (1.0 - values.share(value)) * PANEL_HEIGHT


PNG_SCALE = 2  # pixels of the file for one of the figure, so that lines are smooth
PNG_ANCHORS = {"start": "ls", "middle": "ms", "end": "rs"}  # Pillow's names; s is the base line


def encode_png(figure: Figure) -> bytes:
    """The figure as a PNG file. Raises UsageError without Pillow."""
    try:
        # An optional dependency, needed for PNG only.
        from PIL import Image, ImageDraw, ImageFont, PngImagePlugin
    except ImportError as error:
        cause = "a PNG needs the library Pillow, which is not installed"
        fix = "pip install pillow, or write an .svg"
        raise UsageError(Problem("E-PICTURE", "--output", cause, fix)) from error

    image = Image.new("RGB", (figure.width * PNG_SCALE, figure.height * PNG_SCALE), "white")
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(FONT_SIZE * PNG_SCALE)
    for shape in figure.shapes:
        if isinstance(shape, FigureLine):
            corners = [(x * PNG_SCALE, y * PNG_SCALE) for x, y in shape.points]
            draw.line(corners, shape.colour, round(shape.width * PNG_SCALE), joint="curve")
        else:
            place = (shape.x * PNG_SCALE, shape.y * PNG_SCALE)
            draw.text(place, shape.text, shape.colour, font, anchor=PNG_ANCHORS[shape.anchor])
    mark = PngImagePlugin.PngInfo()
    mark.add_text("Software", "diffbotctl")  # a registered keyword, PNG specification, 11.3.4.2
    file = BytesIO()
    image.save(file, "PNG", pnginfo=mark)
    return file.getvalue()
