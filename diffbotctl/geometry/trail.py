"""The trail of a robot: the latest points of its path that differ visibly."""

from __future__ import annotations

from collections import deque

Point = tuple[float, float]
JUMP_MIN_M = 0.5  # between two points: the pose was set, and the trail begins again


class Trail:
    """`points` in m in odom, the oldest first, at least `spacing` (m) apart, at most `maximum`."""

    def __init__(self, spacing: float, maximum: int) -> None:
        self.spacing = spacing
        self.points: deque[Point] = deque(maxlen=maximum)

    def add(self, point: Point) -> bool:
        """Append the robot's position, unless it has hardly moved. Returns whether it did."""
        last = self.points[-1] if self.points else point
        distance = abs(point[0] - last[0]) + abs(point[1] - last[1])
        if distance > JUMP_MIN_M:
            self.points.clear()
        is_new = distance > self.spacing or not self.points
        if is_new:
            self.points.append(point)
        return is_new
