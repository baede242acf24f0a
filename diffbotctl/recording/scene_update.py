"""`foxglove.SceneUpdate` messages: walls, robot, goal, path and trail, for 3D panels.

Each has a topic of its own: a viewer that jumps in a file restores the newest message of each
topic. Lengths are in m, times in ns since 1970. Objects of the robot are in the frames of its
model, all others in odom.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from math import atan2, cos, hypot, isfinite, sin, sqrt
from typing import Any

from diffbotctl.messages import Goal, Path
from diffbotctl.model.frames import WORLD, Box, Cylinder, Solid, Sphere
from diffbotctl.model.urdf import COLOURS
from diffbotctl.time import SECOND

WALL_HEIGHT_M, WALL_THICKNESS_M = 0.25, 0.01
LINE_HEIGHT_M = 0.002  # above the ground plane of the viewer, which would hide it
GOAL_RADIUS_M, GOAL_HEIGHT_M, ARROW_M = 0.03, 0.004, 0.15
MATCHING_ID, LINE_STRIP = 0, 0  # of SceneEntityDeletionType, LineType
TRAIL_COLOUR = (0.9, 0.5, 0.1, 1.0)
PATH_COLOUR = (0.2, 0.6, 0.9, 0.7)
GOAL_COLOUR = (0.1, 0.7, 0.3, 0.9)
WALL_COLOUR = (0.55, 0.55, 0.6, 0.9)
PRIMITIVES = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
ALONG_Y = (sqrt(0.5), 0.0, 0.0, sqrt(0.5))  # the axis of a cylinder of a scene is z

Fields = dict[str, Any]
Point = tuple[float, float]


def walls(
    time: int, segments: Iterable[Sequence[float]], rounds: Iterable[Sequence[float]]
) -> bytes:
    """The world: `segments` (x1, y1, x2, y2), and round obstacles (x, y, radius)."""
    cubes = [_wall(*segment) for segment in segments]
    cylinders = [
        _cylinder(_pose((x, y, 0.5 * WALL_HEIGHT_M)), radius, WALL_HEIGHT_M, WALL_COLOUR)
        for x, y, radius in rounds
    ]
    return _update([_entity(time, "walls", WORLD, cubes=cubes, cylinders=cylinders)])


def robot(time: int, solids: Iterable[Solid]) -> bytes:
    entities = []
    for solid in solids:
        primitive = _solid(solid)
        entities.append(_entity(time, solid.frame, solid.frame, **primitive))
    return _update(entities)


def goal(time: int, target: Goal) -> bytes | None:
    """The goal as a disc, with an arrow for its heading. Number 0 removes it.

    None for one that is not finite.
    """
    if not target.number:
        deletion = {"timestamp": _time(time), "type": MATCHING_ID, "id": "goal"}
        return json.dumps({"deletions": [deletion], "entities": []}).encode()
    if not (isfinite(target.x) and isfinite(target.y) and isfinite(target.heading or 0.0)):
        return None
    place = (target.x, target.y, 0.5 * GOAL_HEIGHT_M)
    disc = _cylinder(_pose(place), GOAL_RADIUS_M, GOAL_HEIGHT_M, GOAL_COLOUR)
    arrows = [] if target.heading is None else [_arrow(place, target.heading)]
    return _update([_entity(time, "goal", WORLD, cylinders=[disc], arrows=arrows)])


def path(time: int, route: Path) -> bytes:
    points = [(each.x, each.y) for each in route.goals if isfinite(each.x) and isfinite(each.y)]
    return _update([_entity(time, "path", WORLD, lines=[_line(points, PATH_COLOUR)])])


def trail(time: int, points: Iterable[Point]) -> bytes:
    return _update([_entity(time, "trail", WORLD, lines=[_line(points, TRAIL_COLOUR)])])


def _time(time: int) -> Fields:
    seconds, nanoseconds = divmod(time, SECOND)
    return {"sec": seconds, "nsec": nanoseconds}


def _update(entities: list[Fields]) -> bytes:
    return json.dumps({"deletions": [], "entities": entities}).encode()


def _entity(time: int, name: str, frame: str, **primitives: list[Fields]) -> Fields:
    """An entity that stays until it is replaced."""
    return {
        "timestamp": _time(time),
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [],
        **{kind: primitives.get(kind, []) for kind in PRIMITIVES},
    }


def _solid(solid: Solid) -> dict[str, list[Fields]]:
    colour = COLOURS[solid.colour]
    match solid.shape:
        case Box(size):
            return {"cubes": [_shape(_pose(solid.at), size, colour)]}
        case Cylinder(radius, length):
            return {"cylinders": [_cylinder(_pose(solid.at, ALONG_Y), radius, length, colour)]}
        case Sphere(radius):
            return {"spheres": [_shape(_pose(solid.at), (2 * radius,) * 3, colour)]}


def _wall(x1: float, y1: float, x2: float, y2: float) -> Fields:
    middle = (0.5 * (x1 + x2), 0.5 * (y1 + y2), 0.5 * WALL_HEIGHT_M)
    length = hypot(x2 - x1, y2 - y1)
    turn = _about_z(atan2(y2 - y1, x2 - x1))
    return _shape(_pose(middle, turn), (length, WALL_THICKNESS_M, WALL_HEIGHT_M), WALL_COLOUR)


def _arrow(place: Sequence[float], heading: float) -> Fields:
    return {
        "pose": _pose(place, _about_z(heading)),
        "shaft_length": 0.7 * ARROW_M,
        "shaft_diameter": 0.1 * ARROW_M,
        "head_length": 0.3 * ARROW_M,
        "head_diameter": 0.25 * ARROW_M,
        "color": _colour(GOAL_COLOUR),
    }


def _cylinder(pose: Fields, radius: float, length: float, colour: Sequence[float]) -> Fields:
    shape = _shape(pose, (2 * radius, 2 * radius, length), colour)
    return {**shape, "bottom_scale": 1.0, "top_scale": 1.0}


def _shape(pose: Fields, size: Sequence[float], colour: Sequence[float]) -> Fields:
    return {"pose": pose, "size": _vector(size), "color": _colour(colour)}


def _line(points: Iterable[Point], colour: Sequence[float]) -> Fields:
    return {
        "type": LINE_STRIP,
        "pose": _pose((0.0, 0.0, LINE_HEIGHT_M)),
        "thickness": 2.0,
        "scale_invariant": True,  # pixels
        "points": [{"x": round(x, 3), "y": round(y, 3), "z": 0.0} for x, y in points],
        "color": _colour(colour),
        "colors": [],
        "indices": [],
    }


def _pose(place: Sequence[float], turn: Sequence[float] = UPRIGHT) -> Fields:
    x, y, z, w = turn
    return {"position": _vector(place), "orientation": {"x": x, "y": y, "z": z, "w": w}}


def _about_z(angle: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, sin(0.5 * angle), cos(0.5 * angle)


def _vector(values: Sequence[float]) -> Fields:
    x, y, z = values
    return {"x": x, "y": y, "z": z}


def _colour(values: Sequence[float]) -> Fields:
    return dict(zip("rgba", values, strict=True))
