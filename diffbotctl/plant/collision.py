"""Distance from the robot's true outline to the obstacles of the world, in metres.

The outline is a rectangle about the middle of the axle. The result is the plant's truth: for
measurements and tests, never for a block.
"""

from __future__ import annotations

from math import cos, hypot, inf, sin
from typing import NamedTuple

from diffbotctl.geometry.footprint import distance_to_segment
from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.world import Wall, World

Point = tuple[float, float]


class BodyOutline(NamedTuple):
    """Extent of the robot forward, backward and to each side (half its width), m."""

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
    """Distance from the outline at `pose` to the nearest obstacle of `world`; 0 on contact.

    The result is at most `within`: farther obstacles are not searched.
    """
    nearest = within
    reach = hypot(max(outline.front, outline.back), outline.half)
    c, s = cos(pose.heading), sin(pose.heading)
    for pillar in world.pillars:
        x, y = pillar.x - pose.x, pillar.y - pose.y
        if hypot(x, y) - pillar.radius - reach >= nearest:
            continue
        distance = outline.to_point(x * c + y * s, y * c - x * s) - pillar.radius
        nearest = min(nearest, max(distance, 0.0))
    for wall in world.walls:
        if distance_to_segment(pose.x, pose.y, *wall) - reach >= nearest:
            continue
        x1, y1, x2, y2 = wall.x1 - pose.x, wall.y1 - pose.y, wall.x2 - pose.x, wall.y2 - pose.y
        in_base = Wall(x1 * c + y1 * s, y1 * c - x1 * s, x2 * c + y2 * s, y2 * c - x2 * s)
        nearest = min(nearest, to_wall(outline, in_base))
    return nearest


def to_wall(outline: BodyOutline, wall: Wall) -> float:
    """Distance from the outline to a wall in base_link; 0 on contact."""
    if crosses(outline, wall):
        return 0.0
    ends = min(outline.to_point(wall.x1, wall.y1), outline.to_point(wall.x2, wall.y2))
    return min(ends, *(distance_to_segment(*corner, *wall) for corner in outline.corners))


def crosses(outline: BodyOutline, wall: Wall) -> bool:
    """Whether any part of the wall is inside the outline (Liang-Barsky clipping)."""
    first, last = 0.0, 1.0
    along_x, along_y = wall.x2 - wall.x1, wall.y2 - wall.y1
    for step, margin in (
        (-along_x, wall.x1 + outline.back),
        (along_x, outline.front - wall.x1),
        (-along_y, wall.y1 + outline.half),
        (along_y, outline.half - wall.y1),
    ):
        if step == 0.0:
            if margin < 0.0:
                return False
        elif step < 0.0:
            first = max(first, margin / step)
        else:
            last = min(last, margin / step)
    return first <= last
