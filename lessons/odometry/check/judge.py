"""Random curves, and how far the pose of the learner's block is from the true one."""

from math import cos, hypot, pi, remainder, sin
from random import Random

from diffbotctl.block import Block, Every, In, Out
from diffbotctl.messages import Odometry, Text, Twist
from diffbotctl.params import Param

PATH = 6.0  # m
BEGIN = 1.5  # m of the path, from which on the error counts
PART = 0.02  # of the path, the largest error
TURN_MAX = 0.05  # rad, the largest error of the heading


class Curves(Block):
    """Curves to one side, another every second: to both sides their errors would cancel."""

    seed = Param(int, default=1, help="Seed.")
    tick = Every(0.1)
    twist = Out(Twist)

    def reset(self):
        self.rng = Random(self.seed)
        self.side = self.rng.choice((-1.0, 1.0))
        self.count = 0

    def react(self, now, tick):
        if self.count % 10 == 0:
            self.linear = self.rng.uniform(0.4, 0.8)
            self.angular = self.side * self.rng.uniform(0.4, 1.2)
        self.count += 1
        return Twist(now, self.linear, self.angular)


class Judge(Block):
    """An error of less than 2 % of the path, at any time."""

    pose = In(Odometry, trigger=False)
    truth = In(Odometry)
    finding = Out(Text)

    def reset(self):
        self.start = self.last = None
        self.path = 0.0

    def react(self, now, pose, truth):
        if truth is None:
            return None
        if self.last is None:
            self.start = self.last = truth
        self.path += hypot(truth.x - self.last.x, truth.y - self.last.y)
        self.last = truth
        if self.path < BEGIN:
            return None
        if pose is None:
            return Text(now, "silent: no pose came")
        dx, dy = truth.x - self.start.x, truth.y - self.start.y
        c, s = cos(self.start.heading), sin(self.start.heading)
        off = hypot(pose.x - (c * dx + s * dy), pose.y - (c * dy - s * dx))
        turned = truth.heading - self.start.heading
        if not abs(remainder(pose.heading - turned, 2.0 * pi)) <= TURN_MAX:
            seen = f"a heading of {pose.heading:.2f} rad where it is {turned:.2f}, also modulo 2 pi"
            return Text(now, f"heading: {seen}")
        if not off <= PART * self.path:
            seen = f"x {pose.x:.2f} m, y {pose.y:.2f} m, which is {1000.0 * off:.0f} mm off"
            return Text(now, f"position: {seen} after a path of {self.path:.1f} m")
        return Text(now, "passed") if self.path >= PATH else None
