"""A robot seen from above and from its left side, as outlines in metres.

From above x points right and y up, as on the map; from the side x points right and z up, and the
ground is z = 0 of base_footprint.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, sin
from typing import NamedTuple

from diffbotctl.config.robot import Robot
from diffbotctl.model.frames import BASE, RobotFrame, axle_height, frames
from diffbotctl.model.solids import Ball, Box, Cylinder, Solid, solids

Point = tuple[float, float]
CIRCLE = 32  # corners of a drawn circle
GAZE = 0.06  # m; how long the line is that shows where a sensor looks


class DrawingOutline(NamedTuple):
    """A closed line, or an open one, around the part called `name`."""

    name: str
    colour: str
    points: tuple[Point, ...]
    closed: bool = True


class Dimension(NamedTuple):
    """A length to write into the drawing, from one point to another, `label` beside it."""

    start: Point
    end: Point
    label: str


class DrawingView(NamedTuple):
    """One drawing: its title, what is seen, and the lengths written into it."""

    title: str
    outlines: tuple[DrawingOutline, ...]
    dimensions: tuple[Dimension, ...]


def top(robot: Robot) -> DrawingView:
    """`robot` from above."""
    body, places = robot.body, {frame.name: frame for frame in frames(robot)}
    parts = [_from_above(solid, places[solid.frame]) for solid in solids(robot)]
    half = 0.5 * robot.drive.track
    edge = 0.5 * body.width
    lengths = (
        Dimension((-body.back, -edge), (body.front, -edge), _mm("long", body.front + body.back)),
        Dimension((-body.back, -edge), (-body.back, edge), _mm("wide", body.width)),
        Dimension((0.0, -half), (0.0, half), _mm("track", robot.drive.track)),
    )
    return DrawingView("from above", (*parts, *_gazes(robot)), lengths)


def side(robot: Robot) -> DrawingView:
    """`robot` from its left side."""
    body, places = robot.body, {frame.name: frame for frame in frames(robot)}
    height = axle_height(robot)
    parts = [_from_left(solid, places[solid.frame], height) for solid in solids(robot)]
    ground = DrawingOutline("ground", "grey", ((-body.back, 0.0), (body.front, 0.0)), closed=False)
    diameter = robot.drive.left.wheel.diameter
    top_of_it = body.clearance + body.height
    lengths = (
        Dimension((0.0, 0.0), (0.0, diameter), _mm("wheel", diameter)),
        Dimension((-body.back, 0.0), (-body.back, top_of_it), _mm("high", top_of_it)),
    )
    return DrawingView("from the left", (ground, *parts), lengths)


def _from_above(solid: Solid, frame: RobotFrame) -> DrawingOutline:
    x, y = frame.x + solid.at[0], frame.y + solid.at[1]
    match solid.shape:
        case Box(size):
            points = _rectangle(x, y, size[0], size[1], frame.heading)
        case Cylinder(radius, length):
            points = _rectangle(x, y, 2 * radius, length, frame.heading)
        case Ball(radius):
            points = _circle(x, y, radius)
    return DrawingOutline(_name(solid), solid.colour, points)


def _from_left(solid: Solid, frame: RobotFrame, height: float) -> DrawingOutline:
    base = 0.0 if frame.name == BASE else frame.z
    x, z = frame.x + solid.at[0], base + solid.at[2] + height
    match solid.shape:
        case Box(size):
            # A box that looks aside shows its corners' whole reach.
            deep = abs(size[0] * cos(frame.heading)) + abs(size[1] * sin(frame.heading))
            points = _rectangle(x, z, deep, size[2], 0.0)
        case Cylinder(radius) | Ball(radius):
            points = _circle(x, z, radius)
    return DrawingOutline(_name(solid), solid.colour, points)


def _gazes(robot: Robot) -> Iterator[DrawingOutline]:
    for frame in frames(robot):
        if frame.name.endswith("_sensor_link"):
            far = frame.x + GAZE * cos(frame.heading), frame.y + GAZE * sin(frame.heading)
            name = f"{frame.name.removesuffix('_sensor_link')} looks there"
            yield DrawingOutline(name, "red", ((frame.x, frame.y), far), closed=False)


def _rectangle(x: float, y: float, long: float, wide: float, heading: float) -> tuple[Point, ...]:
    ahead, aside = cos(heading), sin(heading)
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return tuple(
        (
            x + 0.5 * (a * long * ahead - b * wide * aside),
            y + 0.5 * (a * long * aside + b * wide * ahead),
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
