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
        pass

    def react(self, now, pose):
        if pose is None:
            return None
        if pose.x < DISTANCE:
            return Twist(pose.time, SPEED, 0.0)
        return None
