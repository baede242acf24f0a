"""Path: a square or a list of waypoints, all in one message."""

from __future__ import annotations

from math import atan2

from diffbotctl.block import Block, Every, Out, action
from diffbotctl.messages import Goal, Path
from diffbotctl.params import Param

Point = tuple[float, float]


class PathSource(Block):
    """Give a path at the start, and again when asked by the action `again`.

    The square begins and ends at the origin, its first side along x. At its end the robot looks
    along x again.

    blocks:
      square: {block: path, with: {side: 1 m, direction: counter_clockwise}}
    """

    shape = Param(str, default="square", choices=("square", "waypoints"), help="What to drive.")
    side = Param(float, unit="m", default=1.0, above=0.0, help="Length of the square's sides.")
    direction = Param(
        str,
        default="counter_clockwise",
        choices=("counter_clockwise", "clockwise"),
        help="Which way round the square.",
    )
    loops = Param(int, default=1, minimum=1, maximum=1000, help="How many times.")
    waypoints = Param(
        list[tuple[float, float]], unit="m", default=[], help="Points [x, y] for `waypoints`."
    )

    tick = Every(0.1)  # s; soon after the start, when all blocks have been reset
    path = Out(Path, help="All waypoints in order.")

    def reset(self) -> None:
        self.is_due = True

    @action
    def again(self, now: int) -> None:
        """Give the path once more."""
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
    """The four corners of a square from the origin, the last one the origin itself, in metres."""
    y = -side if is_clockwise else side
    return [(side, 0.0), (side, y), (0.0, y), (0.0, 0.0)]


def last_heading(points: list[Point]) -> float | None:
    """The heading in rad of the last leg; None for fewer than two points."""
    if len(points) < 2:
        return None
    (from_x, from_y), (to_x, to_y) = points[-2:]
    return atan2(to_y - from_y, to_x - from_x)


def as_goals(now: int, points: list[Point], heading: float | None) -> tuple[Goal, ...]:
    """Goals numbered from 1 at `points`; only the last one asks for a `heading`."""
    last = len(points)
    return tuple(
        Goal(now, number, x, y, heading if number == last else None)
        for number, (x, y) in enumerate(points, 1)
    )
