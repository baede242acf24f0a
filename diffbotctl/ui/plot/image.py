"""Curves as a picture: fields of one unit share a panel, all panels share the axis of time.

Pictures as PNG, drawn by Pillow.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import BytesIO
from math import isnan
from pathlib import Path
from typing import NamedTuple

from diffbotctl.errors import Problem, UsageError
from diffbotctl.recording.fields import Series
from diffbotctl.render.svg import document, mark, points, words
from diffbotctl.ui.plot.axes import Axis, make_axis

WIDTH, PANEL = 900, 240  # pixels of the picture, and of each panel's height
LEFT, RIGHT, TOP, BOTTOM, GAP = 70, 20, 40, 40, 30  # pixels around the panels and between them
TICKS_ACROSS, TICKS_DOWN = 9, 5
MARGIN = 0.04  # of the values' span, so that no curve hides under the frame
SIZE = 12  # pixels of the letters
LETTER = 7.4  # pixels that a letter of that size is wide, at the widest of common fonts
# Okabe and Ito's colours, which people who see fewer colours can tell apart too.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000")
GRID, INK = "#dddddd", "#333333"


class FigureLine(NamedTuple):
    """A line through points (x, y) in pixels from the upper left corner."""

    points: tuple[tuple[float, float], ...]
    colour: str
    width: float


class FigureText(NamedTuple):
    """A text whose `anchor` (start, middle, end) stands at x, its base line at y."""

    x: float
    y: float
    text: str
    anchor: str
    colour: str


class Figure(NamedTuple):
    """A picture of lines and words, in pixels; what comes later lies on top."""

    width: int
    height: int
    shapes: tuple[FigureLine | FigureText, ...]


def make_figure(drawn: Sequence[Series], title: str) -> Figure:
    """The curves in panels, one a unit."""
    panels: dict[str, list[Series]] = {}
    for each in drawn:
        panels.setdefault(each.unit, []).append(each)
    begin = min(each.times[0] for each in drawn)
    end = max(each.times[-1] for each in drawn)
    time = make_axis(begin, end, TICKS_ACROSS)
    shapes: list[FigureLine | FigureText] = [FigureText(LEFT, TOP - 22, title, "start", INK)]
    top = TOP
    for unit, curves in panels.items():
        shapes += _panel(unit, curves, time, top)
        top += PANEL + GAP
    height = top - GAP + BOTTOM
    shapes += _seconds(time, height - BOTTOM)
    return Figure(WIDTH, height, tuple(shapes))


def save_figure(picture: Figure, path: Path) -> None:
    """Write the picture as SVG or PNG, as the ending of `path` says.

    Raises UsageError for another ending, a place that cannot be written, or a missing library.
    """

    writers = {".svg": encode_svg, ".png": encode_png}
    encode = writers.get(path.suffix.lower())
    if encode is None:
        cause = "a picture is written as .svg or .png"
        raise UsageError(Problem("E-PICTURE", str(path), cause, "give --output x.svg"))
    try:
        path.write_bytes(encode(picture))
    except ImportError as error:
        cause = "a PNG needs the library Pillow, which is not installed"
        fix = "pip install pillow, or write an .svg"
        raise UsageError(Problem("E-PICTURE", str(path), cause, fix)) from error
    except OSError as error:
        cause = f"cannot write there: {error.strerror}"
        raise UsageError(Problem("E-PICTURE", str(path), cause)) from error


def encode_svg(picture: Figure) -> bytes:
    """The picture as an SVG document."""
    marks = [
        _line(each) if isinstance(each, FigureLine) else _words(each) for each in picture.shapes
    ]
    return document(
        picture.width, picture.height, marks, font_family="system-ui, sans-serif", font_size=SIZE
    ).encode()


def _line(line: FigureLine) -> str:
    return mark(
        "polyline",
        points=points(line.points),
        fill="none",
        stroke=line.colour,
        stroke_width=line.width,
        stroke_linejoin="round",
    )


def _words(said: FigureText) -> str:
    return words(said.x, said.y, said.text, text_anchor=said.anchor, fill=said.colour)


def _panel(
    unit: str, curves: list[Series], time: Axis, top: float
) -> Iterator[FigureLine | FigureText]:
    bounds = [each.bounds() for each in curves]
    least, most = min(b[0] for b in bounds), max(b[1] for b in bounds)
    room = MARGIN * (most - least)
    values = make_axis(least - room, most + room, TICKS_DOWN)
    right, bottom = WIDTH - RIGHT, top + PANEL
    for tick in values.ticks:
        y = _y(values, tick, top)
        yield FigureLine(((LEFT, y), (right, y)), GRID, 1)
        yield FigureText(LEFT - 6, y + SIZE / 3, values.label(tick), "end", INK)
    for tick in time.ticks:
        x = _x(time, tick)
        yield FigureLine(((x, top), (x, bottom)), GRID, 1)
    if unit:
        yield FigureText(LEFT - 6, top - 6, unit, "end", INK)
    beside = float(LEFT)
    for place, each in enumerate(curves):
        colour = COLOURS[place % len(COLOURS)]
        yield FigureText(beside, top - 6, each.name, "start", colour)
        beside += len(each.name) * LETTER + SIZE
        for piece in _pieces(each, time, values, top):
            yield FigureLine(piece, colour, 1.5)
    frame = ((LEFT, top), (right, top), (right, bottom), (LEFT, bottom), (LEFT, top))
    yield FigureLine(frame, INK, 1)


def _pieces(
    each: Series, time: Axis, values: Axis, top: float
) -> Iterator[tuple[tuple[float, float], ...]]:
    """The curve in pixels, in one piece where it has no gaps."""
    piece: list[tuple[float, float]] = []
    for t, v in zip(each.times, each.values, strict=True):
        if not isnan(v):
            piece.append((_x(time, t), _y(values, v, top)))
            continue
        if piece:
            yield tuple(piece)
        piece = []
    if piece:
        yield tuple(piece)


def _seconds(time: Axis, bottom: float) -> Iterator[FigureText]:
    for tick in time.ticks:
        yield FigureText(_x(time, tick), bottom + SIZE + 6, time.label(tick), "middle", INK)
    yield FigureText(WIDTH - RIGHT, bottom + 2 * SIZE + 10, "s since the start", "end", INK)


def _x(time: Axis, value: float) -> float:
    return LEFT + time.share(value) * (WIDTH - LEFT - RIGHT)


def _y(values: Axis, value: float, top: float) -> float:
    return top + (1.0 - values.share(value)) * PANEL


FINER = 2  # pixels of the file for one of the picture, so that lines are smooth
ANCHORS = {"start": "ls", "middle": "ms", "end": "rs"}  # Pillow's words; s is the base line


def encode_png(picture: Figure) -> bytes:
    """The picture as a PNG file. Raises ImportError without Pillow."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.new("RGB", (picture.width * FINER, picture.height * FINER), "white")
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(SIZE * FINER)
    for shape in picture.shapes:
        if isinstance(shape, FigureLine):
            points = [(x * FINER, y * FINER) for x, y in shape.points]
            draw.line(points, shape.colour, round(shape.width * FINER), joint="curve")
        else:
            place = (shape.x * FINER, shape.y * FINER)
            draw.text(place, shape.text, shape.colour, font, anchor=ANCHORS[shape.anchor])
    file = BytesIO()
    image.save(file, "PNG")
    return file.getvalue()
