from math import hypot

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Odometry, Twist

DISTANCE = 1.0  # m
SPEED = 0.2  # m/s


class Metre(Block):
    """Drive one metre, then stand."""

    pose = In(Odometry, help="Where the robot is.")
    twist = Out(Twist, help="Its velocity.")

    def reset(self):
        self.start = None

    def react(self, now, pose):
        if pose is None:
            return None
        if self.start is None:
            self.start = pose
        driven = hypot(pose.x - self.start.x, pose.y - self.start.y)
        return Twist(pose.time, SPEED if driven < DISTANCE else 0.0, 0.0)
