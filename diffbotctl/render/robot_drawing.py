"""Drawings of a robot from above and from its left side, to scale, with dimensions, as SVG.

Outlines are in metres. From above x points right and y up, as on the map. From the side x points
right and z up, and the ground is z = 0 of base_footprint.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import cos, pi, sin
from typing import NamedTuple
from xml.sax.saxutils import escape

from diffbotctl.config.robot import Robot
from diffbotctl.model.frames import (
    BASE,
    Box,
    Cylinder,
    RobotFrame,
    Solid,
    Sphere,
    axle_height,
    robot_frames,
    robot_solids,
)
from diffbotctl.render.svg import element, points_attribute, svg_document, text_element

Point = tuple[float, float]
CIRCLE = 32  # corners of a polygon that stands for a circle
SENSOR_LINE_LENGTH = 0.06  # m; of the line along the axis of a sensor


class DrawingOutline(NamedTuple):
    """Outline of the part `name`: a polygon, or an open line."""

    name: str
    colour: str
    points: tuple[Point, ...]
    closed: bool = True


class Dimension(NamedTuple):
    """A dimension line between two points, with a label."""

    start: Point
    end: Point
    label: str


class DrawingView(NamedTuple):
    """One view: its title, outlines and dimensions."""

    title: str
    outlines: tuple[DrawingOutline, ...]
    dimensions: tuple[Dimension, ...]


def top_view(robot: Robot) -> DrawingView:
    """`robot` from above."""
    body, places = robot.body, {frame.name: frame for frame in robot_frames(robot)}
    parts = [_from_above(solid, places[solid.frame]) for solid in robot_solids(robot)]
    half = 0.5 * robot.drive.track
    edge = 0.5 * body.width
    dimensions = (
        Dimension((-body.back, -edge), (body.front, -edge), _mm("long", body.front + body.back)),
        Dimension((-body.back, -edge), (-body.back, edge), _mm("wide", body.width)),
        Dimension((0.0, -half), (0.0, half), _mm("track", robot.drive.track)),
    )
    return DrawingView("from above", (*parts, *_sensor_lines(robot)), dimensions)


def side_view(robot: Robot) -> DrawingView:
    """`robot` from its left side."""
    body, places = robot.body, {frame.name: frame for frame in robot_frames(robot)}
    height = axle_height(robot)
    parts = [_from_left(solid, places[solid.frame], height) for solid in robot_solids(robot)]
    ground = DrawingOutline("ground", "grey", ((-body.back, 0.0), (body.front, 0.0)), closed=False)
    diameter = robot.drive.left.wheel.diameter
    top = body.clearance + body.height
    dimensions = (
        Dimension((0.0, 0.0), (0.0, diameter), _mm("wheel", diameter)),
        Dimension((-body.back, 0.0), (-body.back, top), _mm("high", top)),
    )
    return DrawingView("from the left", (ground, *parts), dimensions)


def _from_above(solid: Solid, frame: RobotFrame) -> DrawingOutline:
    x, y = frame.x + solid.at[0], frame.y + solid.at[1]
    match solid.shape:
        case Box(size):
            points = _rectangle(x, y, size[0], size[1], frame.heading)
        case Cylinder(radius, length):
            points = _rectangle(x, y, 2 * radius, length, frame.heading)
        case Sphere(radius):
            points = _circle(x, y, radius)
    return DrawingOutline(_name(solid), solid.colour, points)


def _from_left(solid: Solid, frame: RobotFrame, height: float) -> DrawingOutline:
    base = 0.0 if frame.name == BASE else frame.z
    x, z = frame.x + solid.at[0], base + solid.at[2] + height
    match solid.shape:
        case Box(size):
            # A rotated box is drawn with the extent of its corners.
            depth = abs(size[0] * cos(frame.heading)) + abs(size[1] * sin(frame.heading))
            points = _rectangle(x, z, depth, size[2], 0.0)
        case Cylinder(radius) | Sphere(radius):
            points = _circle(x, z, radius)
    return DrawingOutline(_name(solid), solid.colour, points)


def _sensor_lines(robot: Robot) -> Iterator[DrawingOutline]:
    for frame in robot_frames(robot):
        if frame.name.endswith("_sensor_link"):
            end = (
                frame.x + SENSOR_LINE_LENGTH * cos(frame.heading),
                frame.y + SENSOR_LINE_LENGTH * sin(frame.heading),
            )
            name = f"{frame.name.removesuffix('_sensor_link')} axis"
            yield DrawingOutline(name, "red", ((frame.x, frame.y), end), closed=False)


def _rectangle(
    x: float, y: float, length: float, width: float, heading: float
) -> tuple[Point, ...]:
    c, s = cos(heading), sin(heading)
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return tuple(
        (
            x + 0.5 * (a * length * c - b * width * s),
            y + 0.5 * (a * length * s + b * width * c),
        )
        for a, b in corners
    )


def _circle(x: float, y: float, radius: float) -> tuple[Point, ...]:
    turns = (2 * pi * i / CIRCLE for i in range(CIRCLE))
    return tuple((x + radius * cos(turn), y + radius * sin(turn)) for turn in turns)


def _name(solid: Solid) -> str:
    return "chassis" if solid.frame == BASE else solid.frame.removesuffix("_link")


def _mm(word: str, length: float) -> str:
    return f"{word} {length * 1000:.4g} mm"


WIDTH = 640.0  # px of the wider view
MARGIN = 70.0  # px around a view, for its dimensions
TEXT, NAME_TEXT = 14.0, 11.0  # px
FILLS = {"blue": "#cfe0f7", "black": "#9a9a9a", "grey": "#dddddd", "red": "#f4b6b6"}


class DrawingSheet(NamedTuple):
    """Position of a view in the picture: px per metre, and the pixel of (0, 0)."""

    scale: float
    x: float
    y: float

    def place(self, at: Point) -> Point:
        """The pixel of a point in metres; y points down."""
        return self.x + at[0] * self.scale, self.y - at[1] * self.scale


def drawing_svg(title: str, views: Sequence[DrawingView]) -> str:
    """An SVG document with `views`, one below the other."""
    extents = [_extent(view) for view in views]
    scale = WIDTH / max(right - left for left, right, _, _ in extents)
    above = MARGIN
    inner: list[str] = []
    for view, (left, _, low, high) in zip(views, extents, strict=True):
        sheet = DrawingSheet(scale, MARGIN - left * scale, above + MARGIN + high * scale)
        inner += _view(view, sheet, above)
        above += (high - low) * scale + 2 * MARGIN
    name = text_element(MARGIN, MARGIN / 2, title, font_weight="bold")
    inner += _scale_bar(scale, above)
    return svg_document(
        WIDTH + 2 * MARGIN,
        above + MARGIN / 2,
        [name, *inner],
        font_family="sans-serif",
        font_size=TEXT,
    )


def _scale_bar(scale: float, y: float) -> Iterator[str]:
    """A bar of a round length, at most a third of the picture, with that length."""
    lengths = [m * 10.0**e for e in range(-3, 2) for m in (1, 2, 5)]  # m
    length = max(length for length in lengths if length * scale <= WIDTH / 3 or length == 0.001)
    end = MARGIN + length * scale
    corners = [(MARGIN, y - 5), (MARGIN, y), (end, y), (end, y - 5)]
    yield element(
        "polyline", points=points_attribute(corners), fill="none", stroke="#222222", stroke_width=2
    )
    yield text_element(end + TEXT / 2, y, _mm("", length).strip())


def _view(view: DrawingView, sheet: DrawingSheet, above: float) -> Iterator[str]:
    yield text_element(MARGIN, above + TEXT, view.title)
    for outline in view.outlines:
        yield _outline(outline, sheet)
    yield from _part_names(view, sheet)
    for dimension in view.dimensions:
        yield from _dimension(dimension, sheet)


def _part_names(view: DrawingView, sheet: DrawingSheet) -> Iterator[str]:
    """The name of each part in its lower left corner, or below it where it has no room.

    From the side the left wheel hides the right one, which then has no name.
    """
    shown: set[Point] = set()
    for outline in sorted(view.outlines, key=lambda outline: not outline.name.startswith("left")):
        if not outline.closed:
            continue
        corners = [sheet.place(point) for point in outline.points]
        xs, ys = zip(*corners, strict=True)
        left, right, bottom = min(xs), max(xs), max(ys)
        if (round(left), round(bottom)) in shown:
            continue
        shown.add((round(left), round(bottom)))
        name = outline.name.replace("_", " ")
        is_inside = len(corners) != CIRCLE and NAME_TEXT * len(name) < 1.5 * (right - left)
        x, y = (left + 5, bottom - 5) if is_inside else ((left + right) / 2, bottom + NAME_TEXT)
        anchor = "start" if is_inside else "middle"
        yield text_element(x, y, name, text_anchor=anchor, font_size=NAME_TEXT, fill="#1a1a60")


def _outline(outline: DrawingOutline, sheet: DrawingSheet) -> str:
    return element(
        "polygon" if outline.closed else "polyline",
        element("title", escape(outline.name)),
        data_part=outline.name,
        points=points_attribute(map(sheet.place, outline.points)),
        fill=FILLS[outline.colour] if outline.closed else "none",
        fill_opacity=0.8,
        stroke="#c03030" if outline.colour == "red" else "#222222",
    )


def _dimension(dimension: Dimension, sheet: DrawingSheet) -> Iterator[str]:
    (x1, y1), (x2, y2) = sheet.place(dimension.start), sheet.place(dimension.end)
    upright = abs(x2 - x1) < abs(y2 - y1)
    inside = dimension.start[0] == 0.0 and upright
    # Dimensions of the outline are drawn beside it, those of the axle inside.
    if not inside and upright:
        x1 = x2 = x1 - 2 * TEXT
    elif not inside:
        y1 = y2 = y1 + 1.5 * TEXT
    yield element("line", x1=x1, y1=y1, x2=x2, y2=y2, stroke="#666666", stroke_dasharray="4 3")
    if upright:
        x, y = x1 - TEXT / 3, (y1 + y2) / 2
        turn = f"rotate(-90 {x:.2f} {y:.2f})"
        yield text_element(x, y, dimension.label, text_anchor="middle", transform=turn)
    else:
        x, y = (x1 + x2) / 2, y1 + TEXT * 1.2
        yield text_element(x, y, dimension.label, text_anchor="middle")


def _extent(view: DrawingView) -> tuple[float, float, float, float]:
    """Left, right, lower and upper end of a view, m."""
    points = [point for outline in view.outlines for point in outline.points]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return min(xs), max(xs), min(ys), max(ys)
