"""How an IMU is mounted on the simulated robot: the directions of the axes printed on it."""

from __future__ import annotations

from typing import NamedTuple


class Direction(NamedTuple):
    """A unit vector in the frame of the robot."""

    forward: int
    left: int
    up: int

    def opposite(self) -> Direction:
        """The same line, the other way."""
        return Direction(-self.forward, -self.left, -self.up)


UP = Direction(0, 0, 1)
Directions = tuple[Direction, Direction, Direction]


def axis_directions(upward: str) -> Directions:
    """Directions of the printed axes x, y and z, of which `upward` (such as `-x`) points up.

    The axis after it in the order x, y, z points forward; they are right-handed.
    """
    vertical, sign = "xyz".index(upward[-1]), -1 if upward.startswith("-") else 1
    found = {
        vertical: Direction(0, 0, sign),
        (vertical + 1) % 3: Direction(1, 0, 0),
        (vertical + 2) % 3: Direction(0, sign, 0),
    }
    return found[0], found[1], found[2]


def axis_direction(axis: str, upward: str) -> Direction:
    """The direction of `axis`, with a minus sign its opposite, when `upward` points up."""
    printed = axis_directions(upward)["xyz".index(axis[-1])]
    return printed.opposite() if axis.startswith("-") else printed
