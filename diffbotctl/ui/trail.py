"""The way that a robot came, as a map draws it: its places, no denser than can be seen."""

from __future__ import annotations

from collections import deque

from diffbotctl.ui.camera import Point

STEP = 0.01  # m between two places: finer is not seen
MOST = 3000  # places; then the oldest goes
JUMP = 0.5  # m in one picture: the pose was set anew, the trail begins again


class Trail:
    """`places` in m in odom, the oldest first."""

    def __init__(self) -> None:
        self.places: deque[Point] = deque(maxlen=MOST)

    def see(self, at: Point) -> None:
        """The robot is at `at`."""
        last = self.places[-1] if self.places else at
        step = abs(at[0] - last[0]) + abs(at[1] - last[1])
        if step > JUMP:
            self.places.clear()
        if step > STEP or not self.places:
            self.places.append(at)
