"""How near the robot comes to what it drives at."""

from math import cos, hypot, sin

from diffbotctl.block import Block, Every, FromRobot, In, Out
from diffbotctl.messages import Odometry, Text, Twist
from diffbotctl.params import Param

REST = 1_500_000_000  # ns
FREE, NEAR = 0.10, 0.50  # m


class Forward(Block):
    """Ask for 0.2 m/s, ten times a second."""

    tick = Every(0.1)
    twist = Out(Twist)

    def react(self, now, tick):
        return Twist(now, 0.2, 0.0)


class Judge(Block):
    """It stands 10 to 50 cm before the wall, or the post at the same x."""

    wall = Param(float, unit="m", default=1.0, help="Its x.")
    radius = Param(float, unit="m", default=0.0, help="Of a post; 0: a wall.")
    front = FromRobot("body.front")
    width = FromRobot("body.width")
    pose = In(Odometry)
    finding = Out(Text)

    def reset(self):
        self.last = None
        self.still_since = 0

    def react(self, now, pose):
        if pose is None:
            return None
        c, s = cos(pose.heading), abs(sin(pose.heading))
        gap = self.wall - self.radius - (pose.x + self.front * c + self.width / 2.0 * s)
        if gap < FREE:
            return Text(now, f"near: {100.0 * gap:.0f} cm before the {self._what()}")
        if self.last is None or hypot(pose.x - self.last.x, pose.y - self.last.y) > 0.002:
            self.last, self.still_since = pose, now
        if now - self.still_since < REST:
            return None
        if gap > NEAR:
            return Text(now, f"far: {100.0 * gap:.0f} cm before the {self._what()}")
        return Text(now, "passed")

    def _what(self):
        return "post" if self.radius else "wall"
