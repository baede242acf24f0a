"""Which corners of its square the turtle reaches."""

from math import cos, degrees, hypot, sin

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
            self.begun = f"It began at x {pose.x:.2f} m, y {pose.y:.2f} m, with a heading of "
            self.begun += f"{degrees(pose.heading):.0f} deg, to draw sides of {self.side:.2f} m"
        if self.last is None or hypot(pose.x - self.last.x, pose.y - self.last.y) > 1e-4:
            self.last, self.still_since = pose, now
        x, y = self.corners[self.reached]
        if hypot(pose.x - x, pose.y - y) < NEAR:
            self.reached += 1
            if self.reached == 4:
                return Text(now, "passed")
        if now - self.still_since < REST:
            return None
        seen = f"{self.reached} of 4 corners, and stands at x {pose.x:.2f} m, y {pose.y:.2f} m"
        seen += f"; the next one is at x {x:.2f} m, y {y:.2f} m. {self.begun}"
        return Text(now, f"corners: {seen}")

    def _square(self, pose):
        dx, dy = self.side * cos(pose.heading), self.side * sin(pose.heading)
        x, y = pose.x, pose.y
        return [(x + dx, y + dy), (x + dx - dy, y + dy + dx), (x - dy, y + dx), (x, y)]
