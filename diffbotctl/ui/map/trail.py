"""The way that a robot came, as a map draws it: its places, no denser than can be seen.

What the turtle has drawn on its sheet, kept from the pictures that came so far.
"""

from __future__ import annotations

from collections import deque
from math import hypot

from diffbotctl.messages import Canvas
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.ui import run_text
from diffbotctl.ui.map.canvas import Point

POINT_SPACING_M = 0.01  # m between two places: finer is not seen
TRAIL_MAX_POINTS = 3000  # places; then the oldest goes
JUMP_MIN_M = 0.5  # m in one picture: the pose was set anew, the trail begins again


class Trail:
    """`places` in m in odom, the oldest first."""

    def __init__(self) -> None:
        self.places: deque[Point] = deque(maxlen=TRAIL_MAX_POINTS)

    def see(self, at: Point) -> None:
        """The robot is at `at`."""
        last = self.places[-1] if self.places else at
        step = abs(at[0] - last[0]) + abs(at[1] - last[1])
        if step > JUMP_MIN_M:
            self.places.clear()
        if step > POINT_SPACING_M or not self.places:
            self.places.append(at)


TURTLE_MAX_LINES = 5000  # then the oldest goes


class TurtleTrail:
    """Lines with their colours; `looks` is None for a run that has no canvas."""

    def __init__(self) -> None:
        self.looks: Canvas | None = None
        self.lines: deque[tuple[Point, Point, str]] = deque(maxlen=TURTLE_MAX_LINES)
        self.last: Point | None = None

    def see(self, picture: RunSnapshot) -> None:
        """Take in a picture: the pen goes where the robot is."""
        looks, pose = run_text.newest_message(picture, Canvas), run_text.newest_odometry(picture)
        if not isinstance(looks, Canvas) or pose is None:
            return
        if self.looks is not None and looks.sheet != self.looks.sheet:
            self.lines.clear()
        self.looks = looks
        at = (pose.x, pose.y)
        way = 0.0 if self.last is None else hypot(at[0] - self.last[0], at[1] - self.last[1])
        if self.last is not None and way < POINT_SPACING_M:
            return
        if self.last is not None and looks.is_down and way < JUMP_MIN_M:
            self.lines.append((self.last, at, looks.pen))
        self.last = at

    @property
    def turtles(self) -> list[tuple[Point, float]]:
        """Place and heading of each turtle beside the first."""
        flat = self.looks.turtles if self.looks is not None else ()
        # number, x, y, heading of one after the other
        return [((flat[i + 1], flat[i + 2]), flat[i + 3]) for i in range(0, len(flat), 4)]
