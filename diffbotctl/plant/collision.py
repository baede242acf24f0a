"""How near the robot's outline truly is to what stands in the world. Metres.

The outline is a rectangle about the middle of the axle. What is measured here is the plant's truth:
it serves figures and tests, never a block.
"""

from __future__ import annotations

from math import cos, hypot, inf, sin
from typing import NamedTuple

from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.world import Wall, World

Point = tuple[float, float]


class BodyOutline(NamedTuple):
    """How far the robot reaches forward, backward and, by half its width, to the sides."""

    front: float
    back: float
    half: float

    @property
    def corners(self) -> tuple[Point, ...]:
        """The four corners in base_link."""
        return (
            (self.front, self.half),
            (-self.back, self.half),
            (-self.back, -self.half),
            (self.front, -self.half),
        )

    def to_point(self, x: float, y: float) -> float:
        """Distance to a point in base_link; 0 inside."""
        return hypot(max(-self.back - x, x - self.front, 0.0), max(abs(y) - self.half, 0.0))


def clearance(outline: BodyOutline, pose: Pose, world: World, within: float = inf) -> float:
    """Distance from the outline at `pose` to the nearest thing of `world`; 0 on contact.

    What is farther away than `within` need not be told exactly.
    """
    nearest = within
    reach = hypot(max(outline.front, outline.back), outline.half)
    ahead, aside = cos(pose.heading), sin(pose.heading)
    for thing in world.rounds:
        x, y = thing.x - pose.x, thing.y - pose.y
        if hypot(x, y) - thing.radius - reach >= nearest:
            continue
        far = outline.to_point(x * ahead + y * aside, y * ahead - x * aside) - thing.radius
        nearest = min(nearest, max(far, 0.0))
    for wall in world.walls:
        if to_segment((pose.x, pose.y), wall) - reach >= nearest:
            continue
        x1, y1, x2, y2 = wall.x1 - pose.x, wall.y1 - pose.y, wall.x2 - pose.x, wall.y2 - pose.y
        seen = Wall(
            x1 * ahead + y1 * aside,
            y1 * ahead - x1 * aside,
            x2 * ahead + y2 * aside,
            y2 * ahead - x2 * aside,
        )
        nearest = min(nearest, to_wall(outline, seen))
    return nearest


def to_wall(outline: BodyOutline, wall: Wall) -> float:
    """Distance from the outline to a wall in base_link; 0 where they meet."""
    if crosses(outline, wall):
        return 0.0
    ends = min(outline.to_point(wall.x1, wall.y1), outline.to_point(wall.x2, wall.y2))
    return min(ends, *(to_segment(corner, wall) for corner in outline.corners))


def crosses(outline: BodyOutline, wall: Wall) -> bool:
    """Whether any part of the wall is inside the outline: clipped side by side (Liang-Barsky)."""
    first, last = 0.0, 1.0
    along_x, along_y = wall.x2 - wall.x1, wall.y2 - wall.y1
    for step, room in (
        (-along_x, wall.x1 + outline.back),
        (along_x, outline.front - wall.x1),
        (-along_y, wall.y1 + outline.half),
        (along_y, outline.half - wall.y1),
    ):
        if step == 0.0:
            if room < 0.0:
                return False
        elif step < 0.0:
            first = max(first, room / step)
        else:
            last = min(last, room / step)
    return first <= last


def to_segment(point: Point, wall: Wall) -> float:
    """Distance from a point to a wall."""
    along_x, along_y = wall.x2 - wall.x1, wall.y2 - wall.y1
    from_x, from_y = point[0] - wall.x1, point[1] - wall.y1
    square = along_x * along_x + along_y * along_y
    share = (from_x * along_x + from_y * along_y) / square if square else 0.0
    share = min(max(share, 0.0), 1.0)
    return hypot(from_x - share * along_x, from_y - share * along_y)
