"""What the turtle has drawn on its sheet, kept from the pictures that came so far."""

from __future__ import annotations

from collections import deque
from math import hypot

from diffbotctl.hub.latest import Snapshot
from diffbotctl.messages import Canvas
from diffbotctl.ui import words
from diffbotctl.ui.camera import Point

STEP = 0.01  # m between two ends of a line: finer is not seen
JUMP = 0.5  # m in a tenth of a second that no robot here drives: it was put elsewhere
MOST_LINES = 5000  # then the oldest goes


class Sheet:
    """Lines with their colours; `looks` is None for a run that has no canvas."""

    def __init__(self) -> None:
        self.looks: Canvas | None = None
        self.lines: deque[tuple[Point, Point, str]] = deque(maxlen=MOST_LINES)
        self.last: Point | None = None

    def see(self, picture: Snapshot) -> None:
        """Take in a picture: the pen goes where the robot is."""
        looks, pose = words.newest(picture, Canvas), words.located(picture)
        if not isinstance(looks, Canvas) or pose is None:
            return
        if self.looks is not None and looks.sheet != self.looks.sheet:
            self.lines.clear()
        self.looks = looks
        at = (pose.x, pose.y)
        way = 0.0 if self.last is None else hypot(at[0] - self.last[0], at[1] - self.last[1])
        if self.last is not None and way < STEP:
            return
        if self.last is not None and looks.is_down and way < JUMP:
            self.lines.append((self.last, at, looks.pen))
        self.last = at

    @property
    def turtles(self) -> list[tuple[Point, float]]:
        """Place and heading of each turtle beside the first."""
        flat = self.looks.turtles if self.looks is not None else ()
        # number, x, y, heading of one after the other
        return [((flat[i + 1], flat[i + 2]), flat[i + 3]) for i in range(0, len(flat), 4)]
