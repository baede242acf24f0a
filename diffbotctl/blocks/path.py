"""Path: a square or a list of waypoints, sent as one message."""

from __future__ import annotations

from math import atan2

from diffbotctl.block import Block, Every, Out, action
from diffbotctl.messages import Goal, Path
from diffbotctl.params import Param

Point = tuple[float, float]


class PathSource(Block):
    """Send a path at the start, and again on the action `again`.

    The square starts and ends at the origin with its first side along x. The final heading is 0.

    blocks:
      square: {block: path, with: {side: 1 m, direction: counter_clockwise}}
    """

    shape = Param(str, default="square", choices=("square", "waypoints"), help="Shape of the path.")
    side = Param(float, unit="m", default=1.0, above=0.0, help="Side of the square.")
    direction = Param(
        str,
        default="counter_clockwise",
        choices=("counter_clockwise", "clockwise"),
        help="Direction around the square.",
    )
    loops = Param(int, default=1, minimum=1, maximum=1000, help="Number of rounds.")
    waypoints = Param(
        list[tuple[float, float]], unit="m", default=[], help="Points [x, y] for `waypoints`."
    )

    tick = Every(0.1)  # s; after all blocks have been reset
    path = Out(Path, help="All waypoints in order.")

    def reset(self) -> None:
        self.is_due = True

    @action
    def again(self, now: int) -> None:
        """Send the path again."""
        self.is_due = True

    def react(self, now: int, tick: int | None) -> Path | None:
        if tick is None or not self.is_due:
            return None
        self.is_due = False
        if self.shape == "square":
            points = square(self.side, self.direction == "clockwise") * self.loops
            return Path(tick, as_goals(tick, points, heading=0.0))
        points = list(self.waypoints) * self.loops
        return Path(tick, as_goals(tick, points, heading=last_heading(points)))


def square(side: float, is_clockwise: bool) -> list[Point]:
    """The corners (m) of a square that starts and ends at the origin."""
    y = -side if is_clockwise else side
    return [(side, 0.0), (side, y), (0.0, y), (0.0, 0.0)]


def last_heading(points: list[Point]) -> float | None:
    """Heading (rad) of the last leg; None for fewer than two points."""
    if len(points) < 2:
        return None
    (from_x, from_y), (to_x, to_y) = points[-2:]
    return atan2(to_y - from_y, to_x - from_x)


def as_goals(now: int, points: list[Point], heading: float | None) -> tuple[Goal, ...]:
    """Goals at `points`, numbered from 1; only the last one has a `heading`."""
    last = len(points)
    return tuple(
        Goal(now, number, x, y, heading if number == last else None)
        for number, (x, y) in enumerate(points, 1)
    )
