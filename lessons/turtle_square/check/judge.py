"""Which corners of its square the turtle reaches."""

from math import cos, hypot, sin

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import GoalState, Odometry, Text
from diffbotctl.params import Param

NEAR = 0.005  # m
REST = 3_000_000_000  # ns


class Judge(Block):
    """Four corners in order, each within 5 mm."""

    side = Param(float, unit="m", default=2.0, help="Side.")
    pose = In(Odometry)
    state = In(GoalState, trigger=False)
    finding = Out(Text)

    def reset(self):
        self.corners = None
        self.reached = 0
        self.last = None
        self.still_since = 0

    def react(self, now, pose, state):
        if pose is None:
            return None
        if self.corners is None:
            self.corners = self._square(pose)
        if self.last is None or hypot(pose.x - self.last.x, pose.y - self.last.y) > 1e-4:
            self.last, self.still_since = pose, now
        x, y = self.corners[self.reached]
        if hypot(pose.x - x, pose.y - y) < NEAR:
            self.reached += 1
            if self.reached == 4:
                return Text(now, "passed")
        if now - self.still_since < REST:
            return None
        off = hypot(pose.x - x, pose.y - y)
        seen = f"{self.reached} of 4 corners of a square of {self.side:.2f} m"
        return Text(now, f"corners: {seen}, {1000.0 * off:.0f} mm away from the next one")

    def _square(self, pose):
        dx, dy = self.side * cos(pose.heading), self.side * sin(pose.heading)
        x, y = pose.x, pose.y
        return [(x + dx, y + dy), (x + dx - dy, y + dy + dx), (x - dy, y + dx), (x, y)]
