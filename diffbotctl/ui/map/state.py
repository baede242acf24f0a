"""What the map shows of a run: the newest snapshot, the trail, and the lines of a turtle."""

from __future__ import annotations

from collections import deque
from math import hypot
from typing import NamedTuple

from diffbotctl.geometry.map_tiles import MapTiles
from diffbotctl.geometry.trail import JUMP_MIN_M, Trail
from diffbotctl.messages import Canvas, Pen, TurtlePose
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.render.map_scene import Scene
from diffbotctl.ui.map.canvas import Point
from diffbotctl.ui.run_text import newest_message, newest_odometry

POINT_SPACING_M = 0.01  # closer points coincide on the map
TRAIL_MAX_POINTS = 3000  # then the oldest is dropped
TURTLE_MAX_LINES = 5000  # then the oldest is dropped


class TurtleLine(NamedTuple):
    """A part of a turtle's line: its ends, its colour as #rrggbb, its width in m."""

    start: Point
    end: Point
    colour: str
    width: float


class TurtleTrail:
    """Lines with their colours; `canvas` is None for a run that has no canvas."""

    def __init__(self) -> None:
        self.canvas: Canvas | None = None
        self.lines: deque[TurtleLine] = deque(maxlen=TURTLE_MAX_LINES)
        self.last: dict[int, Point] = {}  # of each turtle, by its number
        self.poses: dict[int, TurtlePose] = {}  # of the further turtles that can be driven

    def update(self, snapshot: RunSnapshot) -> None:
        """Draw from the last position of each turtle to the present one, if the pen is down."""
        canvas, pose = newest_message(snapshot, Canvas), newest_odometry(snapshot)
        if canvas is None or pose is None:
            return
        if self.canvas is not None and canvas.sheet != self.canvas.sheet:
            self.lines.clear()
        self.canvas = canvas
        poses = [each for each in snapshot.messages.values() if isinstance(each, TurtlePose)]
        self.poses = {pose.number: pose for pose in poses}
        present = set(map(int, canvas.turtles[::4]))
        points = {number: (each.x, each.y) for number, each in self.poses.items()}
        points = {number: point for number, point in points.items() if number in present}
        if canvas.has_first:
            points[1] = (pose.x, pose.y)
        pens = dict(zip(map(int, canvas.turtles[::4]), canvas.pens, strict=False))
        pens[1] = first_pen = Pen(canvas.pen, canvas.pen_width, canvas.is_down)
        self.last = {
            number: self._draw(pens.get(number, first_pen), number, point)
            for number, point in points.items()
        }

    def _draw(self, pen: Pen, number: int, point: Point) -> Point:
        """Draw to the present place of a turtle; the place up to which it has drawn."""
        last = self.last.get(number, point)
        distance = hypot(point[0] - last[0], point[1] - last[1])
        if distance < POINT_SPACING_M:
            return last
        if pen.is_down and distance < JUMP_MIN_M:
            self.lines.append(TurtleLine(last, point, pen.colour, pen.width))
        return point

    @property
    def has_first(self) -> bool:
        """False after turtle 1 was killed."""
        return self.canvas is None or self.canvas.has_first

    @property
    def others(self) -> list[tuple[Point, float]]:
        """Place and heading of each turtle except the first."""
        # number, x, y, heading of one after the other
        flat = iter(self.canvas.turtles if self.canvas is not None else ())
        found = []
        for number, x, y, heading in zip(flat, flat, flat, flat, strict=True):
            pose = self.poses.get(int(number))
            found.append(((x, y), heading) if pose is None else ((pose.x, pose.y), pose.heading))
        return found


class MapState:
    """Everything that the map draws."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.snapshot = RunSnapshot(0, {}, 0, 0)
        self.trail = Trail(POINT_SPACING_M, TRAIL_MAX_POINTS)
        self.turtle = TurtleTrail()
        self.tiles = MapTiles()

    def update(self, snapshot: RunSnapshot) -> None:
        self.snapshot = snapshot
        self.turtle.update(snapshot)
        odometry = newest_odometry(snapshot)
        if odometry is not None:
            self.trail.add((odometry.x, odometry.y))
